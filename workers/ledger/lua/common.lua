-- Shared by every script, after the constants that Python writes before it: the letters LOADED, READY,
-- QUEUED, RUNNING, DONE, FAILED, CANCELLED, the stages, ALIVE_S, the classes of fault (redis_ledger.py).
-- P: prefix of one job's keys, G: prefix of all keys. Time is Redis' own, so that no worker's clock
-- matters. A unit's state is "<stage>:<letter>" in its house's hash.
-- Unit "-" is the house as a whole, "0", "1", ... its batches of views. House "-" is the job.
--
-- Keys of a job (P ..):
--   job     hash: state, reason, user, version, recipe, stages, rules of failure, shard_size, shards_left,
--           blocked (queues on which its tasks may not be claimed now, EVERYWHERE = all), blocked_why,
--           notified (its end or pause that was posted to the webhook)
--   n       hash of counters: "<stage>:<letter>", "done:<stage>", "houses:<how>", "batches", "views",
--           "failures:<class>" (attempts), "failed:<class>" (tasks, for good)
--   order   list: "<index>|<house>" not yet admitted       sources  hash: house -> source
--   h:<id>  hash: unit -> state; s: of the house, i: its index, n: batches, left: to end, nf: failed
--   views   hash: house -> batches       shards  hash: shard -> houses still open
--   out:<stage>  list: the outbox        later   sorted set: task by the time it becomes ready
--   queued  sorted set: task by the time its message was sent
--   claims  hash: task -> "<token>|<worker>|<since>", with "|p" after it where it shall end for an urgent job
--   attempts, tried, rejected, failed  hashes by task
--   prints  hash: fingerprint of a fault -> how often
-- Keys of the farm (G ..): leader, jobs, known, notify, breaker, lease:<pool> (sorted set: task by the
-- end of its lease), spent:<day> (hash: user -> seconds), worker:<name> (hash), workers and workers:<stage> (sorted sets: worker by heartbeat).
local P, G = KEYS[1], KEYS[2]

-- What one call reads and writes. A script is atomic: each hash field is read once and written once, at
-- the end, whatever happens to it meanwhile; so are counters, sorted sets and lists. Every script's body
-- is `main`, and `flush` follows it (redis_ledger.py).
local cache, whole, dirty, counts, zsets, pushes = {}, {}, {}, {}, {}, {}
local MOST = 2000 -- arguments of one command

local function fields_of(key)
  if not cache[key] then cache[key] = {} end
  return cache[key]
end

-- Read several fields of a hash at once.
local function hmany(key, fields)
  if whole[key] or #fields == 0 then return end
  local missing, known = {}, fields_of(key)
  for _, field in ipairs(fields) do
    if known[field] == nil then missing[#missing + 1] = field end
  end
  if #missing == 0 then return end
  local values = redis.call('HMGET', key, unpack(missing))
  for i, field in ipairs(missing) do known[field] = values[i] end
end

local function hget(key, field)
  field = tostring(field)
  if fields_of(key)[field] == nil then
    if whole[key] then return nil end
    hmany(key, { field })
  end
  return cache[key][field] or nil
end

-- Read all of a hash; hget then answers from memory.
local function load_hash(key)
  local known = fields_of(key)
  if whole[key] then return end
  local found = redis.call('HGETALL', key)
  for i = 1, #found, 2 do
    if known[found[i]] == nil then known[found[i]] = found[i + 1] end
  end
  whole[key] = true
end

-- All of a hash: field -> value.
local function hall(key)
  load_hash(key)
  local all = {}
  for field, value in pairs(cache[key]) do
    if value then all[field] = value end
  end
  return all
end

local function hset(key, field, value)
  field = tostring(field)
  fields_of(key)[field] = tostring(value)
  dirty[key] = dirty[key] or {}
  dirty[key][field] = true
end

local function hdel(key, field)
  fields_of(key)[field] = false
  dirty[key] = dirty[key] or {}
  dirty[key][field] = true
end

local function hadd(key, field, by)
  local value = tonumber(hget(key, field) or '0') + by
  hset(key, field, value)
  return value
end

-- A member of a sorted set gets a score; false takes it out.
local function zset(key, member, score)
  zsets[key] = zsets[key] or {}
  zsets[key][member] = score
end

local function push(command, key, value) pushes[#pushes + 1] = { command, key, value } end

-- command, key, then all values, in as many calls as they need.
local function in_parts(command, key, values)
  for i = 1, #values, MOST do
    redis.call(command, key, unpack(values, i, math.min(i + MOST - 1, #values)))
  end
end

local function flush()
  -- Counters of a key: one read, one write, however many changed.
  for key, fields in pairs(counts) do
    local changed = {}
    for field, by in pairs(fields) do
      if by ~= 0 then changed[#changed + 1] = field end
    end
    hmany(key, changed)
    for _, field in ipairs(changed) do
      local value = tonumber(hget(key, field) or '0') + fields[field]
      hset(key, field, value % 1 == 0 and string.format('%d', value) or string.format('%.3f', value))
    end
  end
  for key, fields in pairs(dirty) do
    local set, gone = {}, {}
    for field in pairs(fields) do
      local value = cache[key][field]
      if value then
        set[#set + 1] = field
        set[#set + 1] = value
      else
        gone[#gone + 1] = field
      end
    end
    in_parts('HSET', key, set)
    in_parts('HDEL', key, gone)
  end
  for key, members in pairs(zsets) do
    local added, gone = {}, {}
    for member, score in pairs(members) do
      if score then
        added[#added + 1] = score
        added[#added + 1] = member
      else
        gone[#gone + 1] = member
      end
    end
    in_parts('ZADD', key, added)
    in_parts('ZREM', key, gone)
  end
  -- Neighbours of one list go in one command, in their order.
  local values, last = {}, nil
  local function send()
    if last then in_parts(last[1], last[2], values) end
    values = {}
  end
  for _, one in ipairs(pushes) do
    if one[3] then
      if not last or last[1] ~= one[1] or last[2] ~= one[2] then
        send()
        last = one
      end
      values[#values + 1] = one[3]
    end
  end
  send()
  -- The coordinator may be waiting for something to be ready.
  if last and redis.call('LLEN', G .. 'notify') == 0 then redis.call('LPUSH', G .. 'notify', '1') end
  dirty, counts, zsets, pushes = {}, {}, {}, {}
end


-- Seconds since 1970 by Redis' clock, asked once a call.
local clock
local function now()
  if not clock then
    local t = redis.call('TIME')
    clock = tonumber(t[1]) + tonumber(t[2]) / 1000000
  end
  return clock
end

-- Storage is unhealthy: nothing is claimed.
local held
local function is_held()
  if held == nil then held = redis.call('EXISTS', G .. 'breaker') == 1 end
  return held
end

-- A task is "<house>/<unit>/<stage>".
local function split(task) return string.match(task, '^([^/]+)/([^/]+)/([^/]+)$') end
local function task_of(house, unit, stage) return house .. '/' .. unit .. '/' .. stage end
local function house_key(house) return P .. 'h:' .. house end
local function job_field(field)
  load_hash(P .. 'job')
  return hget(P .. 'job', field)
end

-- Counters: changed at the end of the call, read with what the call has changed so far.
local function bump(field, by)
  local key = P .. 'n'
  counts[key] = counts[key] or {}
  counts[key][field] = (counts[key][field] or 0) + by
end
local function count(field)
  local key = P .. 'n'
  return tonumber(hget(key, field) or '0') + ((counts[key] or {})[field] or 0)
end
local function job_of(prefix) return string.match(prefix, '{(.-)}:$') end

-- Leases are kept by pool (workers/ids.py), so that each class of workers can be scaled by its own.
local function lease_key(stage)
  if stage == LIGHT_STAGE and job_field('gpu') == '1' then stage = GPU_LEASE end
  return G .. 'lease:' .. stage
end

-- Stage and letter of a unit, nil when there is no such unit.
local function unit_at(house, unit)
  load_hash(house_key(house))
  local at = hget(house_key(house), unit)
  if not at then return nil end
  return string.match(at, '^(.-):(.)$')
end

-- Move a unit to a state, and the counters of its old and new state with it.
local function set_unit(house, unit, stage, letter)
  local old = hget(house_key(house), unit)
  if old then bump(old, -1) end
  hset(house_key(house), unit, stage .. ':' .. letter)
  bump(stage .. ':' .. letter, 1)
end

-- The transactional outbox: whoever finishes a step puts what follows here, in the same script, and
-- notifies the coordinator if it waits.
local function ready(house, unit, stage, command)
  set_unit(house, unit, stage, READY)
  push(command, P .. 'out:' .. stage, task_of(house, unit, stage))
end

-- Take a task that became ready in this very call out of what will be pushed.
local function take_back(task)
  for _, one in ipairs(pushes) do
    if one[3] == task then one[3] = false end
  end
end

-- Ready, but not before a point in time: a retry after a delay.
local function ready_later(house, unit, stage, at)
  set_unit(house, unit, stage, READY)
  zset(P .. 'later', task_of(house, unit, stage), at)
end

-- End the lease of a task.
local function release(task, stage)
  zset(lease_key(stage), job_of(P) .. '|' .. task, false)
  hdel(P .. 'claims', task)
end

-- The stages a batch of views goes through, in order.
local function batch_stages()
  local names = {}
  for name in string.gmatch(job_field('stages') or '', '[^,]+') do
    names[#names + 1] = name
  end
  return names
end

-- The stage after this one, nil after the last.
local function next_stage(stage)
  local names = batch_stages()
  for i, name in ipairs(names) do
    if name == stage then return names[i + 1] end
  end
  return nil
end

local function pause_job(reason)
  if job_field('state') == 'running' then
    hset(P .. 'job', 'state', 'paused')
    hset(P .. 'job', 'reason', reason)
  end
end

-- Every shard is merged and the job's manifest is written.
local function end_job()
  hset(P .. 'job', 'state', 'done')
  hset(P .. 'job', 'reason', '')
  hset(P .. 'job', 'ended', now())
  zset(G .. 'jobs', job_of(P), false)
end

-- A house needs no more work (how: done, quarantined); the last of a shard has it merged.
local function close_house(house, how)
  local key = house_key(house)
  local shard = math.floor(tonumber(hget(key, 'i')) / tonumber(job_field('shard_size')))
  hset(key, 's', how)
  bump('houses:open', -1)
  bump('houses:' .. how, 1)
  if hadd(P .. 'shards', shard, -1) == 0 then
    ready('-', 's' .. shard, SHARD_STAGE, 'RPUSH')
  end
end

-- One batch fewer is to come, done or failed; the last lets the house be reduced.
local function batch_ended(house)
  if hadd(house_key(house), 'left', -1) == 0 then
    ready(house, '-', REDUCE_STAGE, 'LPUSH')
  end
end

-- The house is read: its batches begin. batches: "view,view;view", one batch per semicolon; "" when the house has no view.
local function open_batches(house, batches)
  local n, first = 0, batch_stages()[1]
  for _ in string.gmatch(batches, '[^;]+') do n = n + 1 end
  for field, value in pairs({ n = n, left = n, nf = 0 }) do hset(house_key(house), field, value) end
  if batches ~= '' then hset(P .. 'views', house, batches) end
  bump('batches', n)
  for i = n - 1, 0, -1 do ready(house, tostring(i), first, 'LPUSH') end
  if n == 0 then ready(house, '-', REDUCE_STAGE, 'LPUSH') end
end

-- A shard or the job itself was merged.
local function advance_job(unit, stage)
  local job = P .. 'job'
  set_unit('-', unit, stage, DONE)
  if stage == SHARD_STAGE then
    if tonumber(hget(P .. 'shards', string.sub(unit, 2))) > 0 then
      -- A house of it was opened again meanwhile: the shard is merged once more after it.
      bump('done:' .. SHARD_STAGE, -1)
      set_unit('-', unit, stage, CANCELLED)
    elseif hadd(job, 'shards_left', -1) == 0 then
      local _, letter = unit_at('-', '-')
      if letter == RUNNING then
        -- It is being merged without this shard: once more afterwards.
        hset(job, 'reduce_again', '1')
      elseif letter ~= READY and letter ~= QUEUED then
        ready('-', '-', JOB_STAGE, 'RPUSH')
      end
    end
  elseif hget(job, 'reduce_again') then
    hdel(job, 'reduce_again')
    bump('done:' .. JOB_STAGE, -1)
    ready('-', '-', JOB_STAGE, 'RPUSH')
  elseif tonumber(hget(job, 'shards_left')) == 0 then
    end_job()
  end
end

-- A task is done: what follows it becomes ready. batches: of views, only after geometry.
local function advance(house, unit, stage, batches)
  bump('done:' .. stage, 1)
  if house == '-' then
    advance_job(unit, stage)
  elseif stage == GEOMETRY_STAGE then
    set_unit(house, unit, stage, DONE)
    hdel(P .. 'sources', house)
    open_batches(house, batches)
  elseif stage == REDUCE_STAGE then
    set_unit(house, unit, stage, DONE)
    if tonumber(hget(house_key(house), 'left')) > 0 then
      bump('done:' .. REDUCE_STAGE, -1) -- a failed batch was tried again meanwhile; reduced after it
    else
      close_house(house, 'done')
    end
  else
    local following = next_stage(stage)
    if following then
      ready(house, unit, following, 'LPUSH')
    else
      set_unit(house, unit, stage, DONE)
      batch_ended(house)
    end
  end
end

-- The rest of the house is cancelled; a running unit learns it at its next heartbeat.
local function quarantine(house)
  for unit, at in pairs(hall(house_key(house))) do
    local stage, letter = string.match(at, '^(%l+):(%l)$')
    local is_open = letter == LOADED or letter == READY or letter == QUEUED or letter == RUNNING
    if stage and is_open and unit ~= 's' then
      release(task_of(house, unit, stage), stage)
      zset(P .. 'queued', task_of(house, unit, stage), false)
      set_unit(house, unit, stage, CANCELLED)
    end
  end
  close_house(house, 'quarantined')
  -- Too many bad houses: something is wrong with the job, not with them.
  local bad, good = count('houses:quarantined'), count('houses:done')
  local most, share = job_field('max_quarantined'), job_field('quarantined_share')
  if bad >= tonumber(most) and bad > tonumber(share) * (bad + good) then
    pause_job(bad .. ' of ' .. (bad + good) .. ' houses are quarantined')
  end
end

-- No more attempts: the unit failed for good, and maybe its house with it.
local function fail_unit(house, unit, stage, entry, fingerprint)
  local task = task_of(house, unit, stage)
  set_unit(house, unit, stage, FAILED)
  hset(P .. 'failed', task, entry)
  hdel(P .. 'attempts', task)
  hdel(P .. 'tried', task)
  local same = hadd(P .. 'prints', fingerprint, 1)
  local most = tonumber(job_field('max_same_failure'))
  if house == '-' then
    pause_job('the reduction ' .. task .. ' failed')
  elseif unit == '-' then
    quarantine(house)
  else
    local key = house_key(house)
    local n_failed = hadd(key, 'nf', 1)
    if n_failed > tonumber(hget(key, 'n')) * tonumber(job_field('failed_share')) then
      quarantine(house)
    else
      batch_ended(house)
    end
  end
  if same >= most then pause_job(same .. ' failures alike: ' .. fingerprint) end
end

-- A claimed task ended badly. f: class, fingerprint, entry (JSON), worker, delay.
local function ended_badly(task, f)
  local house, unit, stage = split(task)
  local attempts = tonumber(hget(P .. 'attempts', task) or '0')
  release(task, stage)
  if job_field('state') == 'cancelled' then
    set_unit(house, unit, stage, CANCELLED)
    return 'cancelled'
  end
  -- Nobody's fault: the attempt is given back.
  if UNCOUNTED[f.class] then
    if attempts <= 1 then
      hdel(P .. 'attempts', task)
    else
      hset(P .. 'attempts', task, attempts - 1)
    end
    bump('handed_back:' .. f.class, 1)
    ready_later(house, unit, stage, now() + f.delay)
    return 'handed back'
  end
  -- Counted: no more attempts, or another one later and elsewhere.
  bump('failures:' .. f.class, 1)
  local most = tonumber(job_field('max_attempts'))
  if f.class == 'data' or attempts >= most then
    bump('failed:' .. f.class, 1)
    fail_unit(house, unit, stage, f.entry, f.fingerprint)
    return 'failed'
  end
  local tried = hget(P .. 'tried', task)
  hset(P .. 'tried', task, (tried and (tried .. ',') or '') .. f.worker)
  ready_later(house, unit, stage, now() + f.delay)
  return 'retry'
end

-- Whether a coordinator leads: only the leader may move work.
local function leads(token) return redis.call('GET', G .. 'leader') == token end

-- What a task works on: the house's source before geometry, its batches of views afterwards.
local function inputs_of(house, stage)
  if house == '-' then return '' end
  return hget(P .. (stage == GEOMETRY_STAGE and 'sources' or 'views'), house) or ''
end

-- Whether the job is blocked for a worker that takes these queues: others wait for what it could do.
-- Merges are never blocked: they are short, and help everybody.
local function is_blocked(stage, queues)
  local blocked = job_field('blocked') or ''
  if blocked == '' or stage == REDUCE_STAGE or stage == SHARD_STAGE or stage == JOB_STAGE then return false end
  if blocked == EVERYWHERE then return true end
  for queue in string.gmatch(blocked, '[^,]+') do
    if string.find(',' .. queues .. ',', ',' .. queue .. ',', 1, true) then return true end
  end
  return false
end

-- May this worker run this task now? The attempt is counted before any work is done.
-- c: token, worker, version, recipe, lease_s, direct (without a message), store ("" = not known),
-- alone (nothing else was claimed in this call), no_more (nothing else may be claimed in it)
-- -> {verdict, detail, inputs}; verdict "run" carries the attempt as detail
local function claim(task, c)
  local house, unit, stage = split(task)
  if not house then return { 'unknown', '', '' } end
  -- Answer what needs no claim: nothing there, past its stage, ended.
  local at_stage, letter = unit_at(house, unit)
  if not job_field('state') or not at_stage then return { 'unknown', '', '' } end
  if at_stage ~= stage or letter == DONE then return { 'done', '', '' } end
  if letter == FAILED then return { 'failed', '', '' } end
  if letter == CANCELLED then return { 'cancelled', '', '' } end
  -- Somebody holds it, maybe we ourselves.
  if letter == RUNNING then
    local held = hget(P .. 'claims', task) or ''
    if string.match(held, '^([^|]*)|') == c.token then -- asked again after a lost answer
      return { 'run', hget(P .. 'attempts', task), inputs_of(house, stage) }
    end
    return { 'leased', held, '' }
  end
  if letter ~= QUEUED and not (letter == READY and c.direct) then return { 'early', '', '' } end
  if job_field('state') == 'cancelled' then
    zset(P .. 'queued', task, false)
    set_unit(house, unit, stage, CANCELLED)
    return { 'cancelled', '', '' }
  end

  local t = now()
  -- Not now, or not here: the task becomes ready again, after a delay if there is one.
  local function reject(verdict, detail, delay)
    if letter == QUEUED then
      zset(P .. 'queued', task, false)
      if delay > 0 then
        ready_later(house, unit, stage, t + delay)
      else
        ready(house, unit, stage, 'LPUSH')
      end
    end
    return { verdict, detail, '' }
  end

  -- Refuse what must wait: the job, storage, or this worker forbids it.
  if job_field('state') ~= 'running' and stage ~= JOB_STAGE then return reject('paused', '', 0) end
  if is_held() then return reject('held', 'storage is unhealthy', 0) end
  if job_field('version') ~= c.version then return reject('version', job_field('version'), 15) end
  if job_field('recipe') ~= c.recipe then return reject('recipe', job_field('recipe'), 15) end
  local store = job_field('store_id') or ''
  if store ~= '' and c.store ~= '' and store ~= c.store then return reject('store', store, 15) end
  local self = G .. 'worker:' .. c.worker
  hmany(self, { 'drain', 'cooling_until', 'streak', 'queues' })
  if hget(self, 'drain') == '1' then return reject('draining', '', 0) end
  if is_blocked(stage, hget(self, 'queues') or '') then
    return reject('blocked', job_field('blocked_why') or '', 1)
  end
  local cooling = hget(self, 'cooling_until')
  if cooling and tonumber(cooling) > t then return reject('cooling', cooling, 2) end

  -- What failed once runs by itself: it may take others with it.
  local n_before = tonumber(hget(P .. 'attempts', task) or '0')
  if c.no_more or (n_before > 0 and not c.alone) then return reject('alone', '', 0) end
  -- A failed attempt is repeated elsewhere as long as anybody else could do it.
  local tried = n_before > 0 and hget(P .. 'tried', task)
  if tried and string.find(',' .. tried .. ',', ',' .. c.worker .. ',', 1, true) then
    local pool = G .. 'workers:' .. stage
    local others = redis.call('ZCOUNT', pool, t - ALIVE_S, '+inf')
    local seen = {}
    for name in string.gmatch(tried, '[^,]+') do
      local seen_at = redis.call('ZSCORE', pool, name)
      if not seen[name] and seen_at and tonumber(seen_at) > t - ALIVE_S then others = others - 1 end
      seen[name] = true
    end
    if others > 0 and hadd(P .. 'rejected', task, 1) <= 20 then
      return reject('elsewhere', tried, 3)
    end
  end

  -- Count the attempt and take the lease.
  if letter == QUEUED then zset(P .. 'queued', task, false) end
  if letter == READY then take_back(task) end
  if n_before > 0 then hdel(P .. 'rejected', task) end
  hset(P .. 'attempts', task, n_before + 1)
  set_unit(house, unit, stage, RUNNING)
  zset(lease_key(stage), job_of(P) .. '|' .. task, t + c.lease_s)
  hset(P .. 'claims', task, c.token .. '|' .. c.worker .. '|' .. string.format('%.3f', t))
  return { 'run', tostring(n_before + 1), inputs_of(house, stage) }
end
