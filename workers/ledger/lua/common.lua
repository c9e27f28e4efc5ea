-- Shared by every script, after the constants that Python tells: the letters LOADED, READY, QUEUED,
-- RUNNING, DONE, FAILED, CANCELLED, the stages, ALIVE_S, the classes of fault (redis_ledger.py).
-- P: prefix of one job's keys, G: prefix of all keys. Time is Redis' own, so that no worker's clock
-- matters. A unit's state is "<stage>:<letter>" in its house's hash.
-- Unit "-" is the house as a whole, "0", "1", ... its batches of views. House "-" is the job.
--
-- Keys of a job (P ..):
--   job     hash: state, reason, version, recipe, stages, rules of failure, shard_size, shards_left
--   n       hash of counters: "<stage>:<letter>", "done:<stage>", "houses:<how>", "batches", "views",
--           "failures:<class>" (attempts), "failed:<class>" (tasks, for good)
--   order   list: "<index>|<house>" not yet admitted       sources  hash: house -> source
--   h:<id>  hash: unit -> state; s: of the house, i: its index, n: batches, left: to end, nf: failed
--   views   hash: house -> batches       shards  hash: shard -> houses still open
--   out:<stage>  list: the outbox        later   sorted set: task by the time it becomes ready
--   queued  sorted set: task by the time its message was sent
--   claims  hash: task -> "<token>|<worker>|<since>"       attempts, tried, rejected, failed: by task
--   prints  hash: fingerprint of a fault -> how often
-- Keys of the farm (G ..): leader, jobs, known, notify, breaker, lease:<queue> (sorted set: task by the
-- end of its lease), worker:<name> (hash), workers and workers:<stage> (sorted sets: worker by heartbeat).
local P, G = KEYS[1], KEYS[2]

-- Seconds since 1970 by Redis' clock.
local function now()
  local t = redis.call('TIME')
  return tonumber(t[1]) + tonumber(t[2]) / 1000000
end

-- A task is "<house>/<unit>/<stage>".
local function split(task) return string.match(task, '^([^/]+)/([^/]+)/([^/]+)$') end
local function task_of(house, unit, stage) return house .. '/' .. unit .. '/' .. stage end
local function house_key(house) return P .. 'h:' .. house end
local function bump(field, by) return redis.call('HINCRBY', P .. 'n', field, by) end
local function job_of(prefix) return string.match(prefix, '{(.-)}:$') end

-- Leases are kept by queue, so that each class of workers can be scaled by its own.
local function lease_key(stage)
  if stage == LIGHT_STAGE and redis.call('HGET', P .. 'job', 'gpu') == '1' then stage = GPU_LEASE end
  return G .. 'lease:' .. stage
end

-- Stage and letter of a unit, nil when there is no such unit.
local function unit_at(house, unit)
  local at = redis.call('HGET', house_key(house), unit)
  if not at then return nil end
  return string.match(at, '^(.-):(.)$')
end

-- Move a unit to a state, and the counters of its old and new state with it.
local function set_unit(house, unit, stage, letter)
  local old = redis.call('HGET', house_key(house), unit)
  if old then bump(old, -1) end
  redis.call('HSET', house_key(house), unit, stage .. ':' .. letter)
  bump(stage .. ':' .. letter, 1)
end

-- The transactional outbox: whoever finishes a step puts what follows here, in the same script, and
-- notifies the coordinator if it waits.
local function ready(house, unit, stage, push)
  set_unit(house, unit, stage, READY)
  redis.call(push, P .. 'out:' .. stage, task_of(house, unit, stage))
  if redis.call('LLEN', G .. 'notify') == 0 then redis.call('LPUSH', G .. 'notify', '1') end
end

-- Ready, but not before a point in time: a retry after a delay.
local function ready_later(house, unit, stage, at)
  set_unit(house, unit, stage, READY)
  redis.call('ZADD', P .. 'later', at, task_of(house, unit, stage))
end

-- End the lease of a task.
local function release(task, stage)
  redis.call('ZREM', lease_key(stage), job_of(P) .. '|' .. task)
  redis.call('HDEL', P .. 'claims', task)
end

-- The stages a batch of views goes through, in order.
local function batch_stages()
  local names = {}
  for name in string.gmatch(redis.call('HGET', P .. 'job', 'stages') or '', '[^,]+') do
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
  if redis.call('HGET', P .. 'job', 'state') == 'running' then
    redis.call('HSET', P .. 'job', 'state', 'paused', 'reason', reason)
  end
end

-- Every shard is merged and the job's manifest is written.
local function end_job()
  redis.call('HSET', P .. 'job', 'state', 'done', 'reason', '', 'ended', now())
  redis.call('ZREM', G .. 'jobs', job_of(P))
end

-- A house needs no more work (how: done, quarantined); the last of a shard has it merged.
local function close_house(house, how)
  local key = house_key(house)
  local shard = math.floor(tonumber(redis.call('HGET', key, 'i'))
    / tonumber(redis.call('HGET', P .. 'job', 'shard_size')))
  redis.call('HSET', key, 's', how)
  bump('houses:open', -1)
  bump('houses:' .. how, 1)
  if redis.call('HINCRBY', P .. 'shards', shard, -1) == 0 then
    ready('-', 's' .. shard, SHARD_STAGE, 'RPUSH')
  end
end

-- One batch fewer is to come, done or failed; the last lets the house be reduced.
local function batch_ended(house)
  if redis.call('HINCRBY', house_key(house), 'left', -1) == 0 then
    ready(house, '-', REDUCE_STAGE, 'LPUSH')
  end
end

-- The house is read: its batches begin. batches: "view,view;view", one batch per semicolon; "" when the house has no view.
local function open_batches(house, batches)
  local n, first = 0, batch_stages()[1]
  for _ in string.gmatch(batches, '[^;]+') do n = n + 1 end
  redis.call('HSET', house_key(house), 'n', n, 'left', n, 'nf', 0)
  if batches ~= '' then redis.call('HSET', P .. 'views', house, batches) end
  bump('batches', n)
  for i = n - 1, 0, -1 do ready(house, tostring(i), first, 'LPUSH') end
  if n == 0 then ready(house, '-', REDUCE_STAGE, 'LPUSH') end
end

-- A shard or the job itself was merged.
local function advance_job(unit, stage)
  local job = P .. 'job'
  set_unit('-', unit, stage, DONE)
  if stage == SHARD_STAGE then
    if tonumber(redis.call('HGET', P .. 'shards', string.sub(unit, 2))) > 0 then
      -- A house of it was opened again meanwhile: the shard is merged once more after it.
      bump('done:' .. SHARD_STAGE, -1)
      set_unit('-', unit, stage, CANCELLED)
    elseif redis.call('HINCRBY', job, 'shards_left', -1) == 0 then
      local _, letter = unit_at('-', '-')
      if letter == RUNNING then
        -- It is being merged without this shard: once more afterwards.
        redis.call('HSET', job, 'reduce_again', '1')
      elseif letter ~= READY and letter ~= QUEUED then
        ready('-', '-', JOB_STAGE, 'RPUSH')
      end
    end
  elseif redis.call('HDEL', job, 'reduce_again') == 1 then
    bump('done:' .. JOB_STAGE, -1)
    ready('-', '-', JOB_STAGE, 'RPUSH')
  elseif tonumber(redis.call('HGET', job, 'shards_left')) == 0 then
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
    redis.call('HDEL', P .. 'sources', house)
    open_batches(house, batches)
  elseif stage == REDUCE_STAGE then
    set_unit(house, unit, stage, DONE)
    if tonumber(redis.call('HGET', house_key(house), 'left')) > 0 then
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
  local fields = redis.call('HGETALL', house_key(house))
  for i = 1, #fields, 2 do
    local stage, letter = string.match(fields[i + 1], '^(%l+):(%l)$')
    local is_open = letter == LOADED or letter == READY or letter == QUEUED or letter == RUNNING
    if stage and is_open and fields[i] ~= 's' then
      release(task_of(house, fields[i], stage), stage)
      redis.call('ZREM', P .. 'queued', task_of(house, fields[i], stage))
      set_unit(house, fields[i], stage, CANCELLED)
    end
  end
  close_house(house, 'quarantined')
  -- Too many bad houses: something is wrong with the job, not with them.
  local bad = tonumber(redis.call('HGET', P .. 'n', 'houses:quarantined'))
  local good = tonumber(redis.call('HGET', P .. 'n', 'houses:done') or '0')
  local rule = redis.call('HMGET', P .. 'job', 'max_quarantined', 'quarantined_share')
  if bad >= tonumber(rule[1]) and bad > tonumber(rule[2]) * (bad + good) then
    pause_job(bad .. ' of ' .. (bad + good) .. ' houses are quarantined')
  end
end

-- No more attempts: the unit failed for good, and maybe its house with it.
local function fail_unit(house, unit, stage, entry, fingerprint)
  local task = task_of(house, unit, stage)
  set_unit(house, unit, stage, FAILED)
  redis.call('HSET', P .. 'failed', task, entry)
  redis.call('HDEL', P .. 'attempts', task)
  redis.call('HDEL', P .. 'tried', task)
  local same = redis.call('HINCRBY', P .. 'prints', fingerprint, 1)
  local most = tonumber(redis.call('HGET', P .. 'job', 'max_same_failure'))
  if house == '-' then
    pause_job('the reduction ' .. task .. ' failed')
  elseif unit == '-' then
    quarantine(house)
  else
    local key = house_key(house)
    local n_failed = redis.call('HINCRBY', key, 'nf', 1)
    local n = tonumber(redis.call('HGET', key, 'n'))
    if n_failed > n * tonumber(redis.call('HGET', P .. 'job', 'failed_share')) then
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
  local attempts = tonumber(redis.call('HGET', P .. 'attempts', task) or '0')
  release(task, stage)
  if redis.call('HGET', P .. 'job', 'state') == 'cancelled' then
    set_unit(house, unit, stage, CANCELLED)
    return 'cancelled'
  end
  -- Nobody's fault: the attempt is given back.
  if UNCOUNTED[f.class] then
    if attempts <= 1 then
      redis.call('HDEL', P .. 'attempts', task)
    else
      redis.call('HSET', P .. 'attempts', task, attempts - 1)
    end
    bump('handed_back:' .. f.class, 1)
    ready_later(house, unit, stage, now() + f.delay)
    return 'handed back'
  end
  -- Counted: no more attempts, or another one later and elsewhere.
  bump('failures:' .. f.class, 1)
  local most = tonumber(redis.call('HGET', P .. 'job', 'max_attempts'))
  if f.class == 'data' or attempts >= most then
    bump('failed:' .. f.class, 1)
    fail_unit(house, unit, stage, f.entry, f.fingerprint)
    return 'failed'
  end
  local tried = redis.call('HGET', P .. 'tried', task)
  redis.call('HSET', P .. 'tried', task, (tried and (tried .. ',') or '') .. f.worker)
  ready_later(house, unit, stage, now() + f.delay)
  return 'retry'
end

-- Only the leading coordinator may move work; a deposed one is told so.
local function leads(token) return redis.call('GET', G .. 'leader') == token end
