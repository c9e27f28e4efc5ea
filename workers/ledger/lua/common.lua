-- Shared by every script. P: prefix of one job's keys, G: prefix of all keys. Time is Redis' own,
-- so that no worker's clock matters. A unit's state is "<stage>:<letter>" in its house's hash:
--   l loaded, not admitted   w ready, in the outbox or waiting   q message sent   r running, leased
--   d done   f failed for good   x cancelled
-- Unit "-" is the house as a whole, "0", "1", ... its groups of views. House "-" is the job.
local P, G = KEYS[1], KEYS[2]

local function now()
  local t = redis.call('TIME')
  return tonumber(t[1]) + tonumber(t[2]) / 1000000
end

local function split(task) return string.match(task, '^([^/]+)/([^/]+)/([^/]+)$') end
local function task_of(house, unit, stage) return house .. '/' .. unit .. '/' .. stage end
local function house_key(house) return P .. 'h:' .. house end
local function bump(field, by) return redis.call('HINCRBY', P .. 'n', field, by) end
local function job_of(prefix) return string.match(prefix, '{(.-)}:$') end

-- Leases are kept by queue, so that each class of workers can be scaled by its own.
local function lease_key(stage)
  if stage == 'light' and redis.call('HGET', P .. 'job', 'gpu') == '1' then stage = 'light.gpu' end
  return G .. 'lease:' .. stage
end

local function unit_at(house, unit)
  local at = redis.call('HGET', house_key(house), unit)
  if not at then return nil end
  return string.match(at, '^(.-):(.)$')
end

local function set_unit(house, unit, stage, letter)
  local old = redis.call('HGET', house_key(house), unit)
  if old then bump(old, -1) end
  redis.call('HSET', house_key(house), unit, stage .. ':' .. letter)
  bump(stage .. ':' .. letter, 1)
end

-- The transactional outbox: whoever finishes a step puts what follows here, in the same script, and
-- wakes the coordinator if it rests.
local function ready(house, unit, stage, push)
  set_unit(house, unit, stage, 'w')
  redis.call(push, P .. 'out:' .. stage, task_of(house, unit, stage))
  if redis.call('LLEN', G .. 'wake') == 0 then redis.call('LPUSH', G .. 'wake', '1') end
end

local function ready_later(house, unit, stage, at)
  set_unit(house, unit, stage, 'w')
  redis.call('ZADD', P .. 'later', at, task_of(house, unit, stage))
end

local function release(task, stage)
  redis.call('ZREM', lease_key(stage), job_of(P) .. '|' .. task)
  redis.call('HDEL', P .. 'claims', task)
end

local function group_stages()
  local names = {}
  for name in string.gmatch(redis.call('HGET', P .. 'job', 'stages') or '', '[^,]+') do
    names[#names + 1] = name
  end
  return names
end

local function next_stage(stage)
  local names = group_stages()
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

local function end_job()
  redis.call('HSET', P .. 'job', 'state', 'done', 'reason', '', 'ended', now())
  redis.call('ZREM', G .. 'jobs', job_of(P))
end

local function close_house(house, how)
  local key = house_key(house)
  local shard = math.floor(tonumber(redis.call('HGET', key, 'i'))
    / tonumber(redis.call('HGET', P .. 'job', 'shard_size')))
  redis.call('HSET', key, 's', how)
  bump('houses:open', -1)
  bump('houses:' .. how, 1)
  if redis.call('HINCRBY', P .. 'shards', shard, -1) == 0 then
    ready('-', 's' .. shard, 'shard', 'RPUSH')
  end
end

local function group_ended(house)
  if redis.call('HINCRBY', house_key(house), 'left', -1) == 0 then
    ready(house, '-', 'reduce', 'LPUSH')
  end
end

-- groups: "view,view;view", one group per semicolon; "" when the house has no view.
local function open_groups(house, groups)
  local n, first = 0, group_stages()[1]
  for _ in string.gmatch(groups, '[^;]+') do n = n + 1 end
  redis.call('HSET', house_key(house), 'n', n, 'left', n, 'nf', 0)
  if groups ~= '' then redis.call('HSET', P .. 'views', house, groups) end
  bump('groups', n)
  for i = n - 1, 0, -1 do ready(house, tostring(i), first, 'LPUSH') end
  if n == 0 then ready(house, '-', 'reduce', 'LPUSH') end
end

local function advance_job(unit, stage)
  local job = P .. 'job'
  set_unit('-', unit, stage, 'd')
  if stage == 'shard' then
    if tonumber(redis.call('HGET', P .. 'shards', string.sub(unit, 2))) > 0 then
      -- A house of it was opened again meanwhile: the shard is merged once more after it.
      bump('done:shard', -1)
      set_unit('-', unit, stage, 'x')
    elseif redis.call('HINCRBY', job, 'shards_left', -1) == 0 then
      local _, letter = unit_at('-', '-')
      if letter == 'r' then
        redis.call('HSET', job, 'reduce_again', '1')
      elseif letter ~= 'w' and letter ~= 'q' then
        ready('-', '-', 'job', 'RPUSH')
      end
    end
  elseif redis.call('HDEL', job, 'reduce_again') == 1 then
    bump('done:job', -1)
    ready('-', '-', 'job', 'RPUSH')
  elseif tonumber(redis.call('HGET', job, 'shards_left')) == 0 then
    end_job()
  end
end

local function advance(house, unit, stage, groups)
  bump('done:' .. stage, 1)
  if house == '-' then
    advance_job(unit, stage)
  elseif stage == 'geometry' then
    set_unit(house, unit, stage, 'd')
    redis.call('HDEL', P .. 'sources', house)
    open_groups(house, groups)
  elseif stage == 'reduce' then
    set_unit(house, unit, stage, 'd')
    if tonumber(redis.call('HGET', house_key(house), 'left')) > 0 then
      bump('done:reduce', -1) -- a failed group was tried again meanwhile; reduced after it
    else
      close_house(house, 'done')
    end
  else
    local following = next_stage(stage)
    if following then
      ready(house, unit, following, 'LPUSH')
    else
      set_unit(house, unit, stage, 'd')
      group_ended(house)
    end
  end
end

-- The rest of the house is cancelled; a running unit learns it at its next beat.
local function quarantine(house)
  local fields = redis.call('HGETALL', house_key(house))
  for i = 1, #fields, 2 do
    local stage, letter = string.match(fields[i + 1], '^(%l+):([lwqr])$')
    if stage and fields[i] ~= 's' then
      release(task_of(house, fields[i], stage), stage)
      redis.call('ZREM', P .. 'queued', task_of(house, fields[i], stage))
      set_unit(house, fields[i], stage, 'x')
    end
  end
  close_house(house, 'quarantined')
  local bad = tonumber(redis.call('HGET', P .. 'n', 'houses:quarantined'))
  local good = tonumber(redis.call('HGET', P .. 'n', 'houses:done') or '0')
  local rule = redis.call('HMGET', P .. 'job', 'max_quarantined', 'quarantined_share')
  if bad >= tonumber(rule[1]) and bad > tonumber(rule[2]) * (bad + good) then
    pause_job(bad .. ' of ' .. (bad + good) .. ' houses are quarantined')
  end
end

local function fail_unit(house, unit, stage, entry, fingerprint)
  local task = task_of(house, unit, stage)
  set_unit(house, unit, stage, 'f')
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
      group_ended(house)
    end
  end
  if same >= most then pause_job(same .. ' failures alike: ' .. fingerprint) end
end

-- Classes that are nobody's fault: the attempt is given back.
local FREE = { preempted = true, storage = true, version = true, drained = true }

-- A claimed task ended badly. f: class, fingerprint, entry (JSON), worker, delay.
local function ended_badly(task, f)
  local house, unit, stage = split(task)
  local attempts = tonumber(redis.call('HGET', P .. 'attempts', task) or '0')
  release(task, stage)
  if redis.call('HGET', P .. 'job', 'state') == 'cancelled' then
    set_unit(house, unit, stage, 'x')
    return 'cancelled'
  end
  if FREE[f.class] then
    if attempts <= 1 then
      redis.call('HDEL', P .. 'attempts', task)
    else
      redis.call('HSET', P .. 'attempts', task, attempts - 1)
    end
    bump('handed_back:' .. f.class, 1)
    ready_later(house, unit, stage, now() + f.delay)
    return 'handed back'
  end
  bump('failures:' .. f.class, 1)
  local most = tonumber(redis.call('HGET', P .. 'job', 'max_attempts'))
  if f.class == 'data' or attempts >= most then
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
