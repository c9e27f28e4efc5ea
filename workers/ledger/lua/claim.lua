-- May this worker run this task now? The attempt is counted before any work is done.
-- ARGV: task, token, worker, version, recipe digest, lease seconds, direct ("1": without a message),
-- id of the worker's store ("" = not known)
-- -> {verdict, detail, inputs}; verdict "run" carries the attempt as detail; inputs: the house's
-- source before geometry, its batches of views afterwards.
local task, token, worker = ARGV[1], ARGV[2], ARGV[3]
local house, unit, stage = split(task)
if not house then return { 'unknown', '', '' } end
-- Answer what needs no claim: nothing there, past its stage, ended.
local job = redis.call('HMGET', P .. 'job', 'state', 'version', 'recipe', 'store_id')
local at_stage, letter = unit_at(house, unit)
if not job[1] or not at_stage then return { 'unknown', '', '' } end
if at_stage ~= stage or letter == DONE then return { 'done', '', '' } end
if letter == FAILED then return { 'failed', '', '' } end
if letter == CANCELLED then return { 'cancelled', '', '' } end

-- What the task works on.
local function inputs()
  if house == '-' then return '' end
  if stage == GEOMETRY_STAGE then return redis.call('HGET', P .. 'sources', house) or '' end
  return redis.call('HGET', P .. 'views', house) or ''
end

-- Somebody holds it, maybe we ourselves.
if letter == RUNNING then
  local claim = redis.call('HGET', P .. 'claims', task) or ''
  if string.match(claim, '^([^|]*)|') == token then -- asked again after a lost answer
    return { 'run', redis.call('HGET', P .. 'attempts', task), inputs() }
  end
  return { 'leased', claim, '' }
end
if letter ~= QUEUED and not (letter == READY and ARGV[7] == '1') then return { 'early', '', '' } end
if job[1] == 'cancelled' then
  redis.call('ZREM', P .. 'queued', task)
  set_unit(house, unit, stage, CANCELLED)
  return { 'cancelled', '', '' }
end

local t = now()
-- Not now, or not here: the task becomes ready again, after a delay if there is one.
local function reject(verdict, detail, delay)
  if letter == QUEUED then
    redis.call('ZREM', P .. 'queued', task)
    if delay > 0 then
      ready_later(house, unit, stage, t + delay)
    else
      ready(house, unit, stage, 'LPUSH')
    end
  end
  return { verdict, detail, '' }
end

-- Refuse what must wait: the job, storage, or this worker forbids it.
if job[1] ~= 'running' and stage ~= JOB_STAGE then return reject('paused', '', 0) end
if redis.call('EXISTS', G .. 'breaker') == 1 then return reject('held', 'storage is unhealthy', 0) end
if job[2] ~= ARGV[4] then return reject('version', job[2], 15) end
if job[3] ~= ARGV[5] then return reject('recipe', job[3], 15) end
local has_store = job[4] and job[4] ~= '' and ARGV[8] and ARGV[8] ~= ''
if has_store and job[4] ~= ARGV[8] then return reject('store', job[4], 15) end
local self = redis.call('HMGET', G .. 'worker:' .. worker, 'drain', 'blocked_until')
if self[1] == '1' then return reject('draining', '', 0) end
if self[2] and tonumber(self[2]) > t then return reject('blocked', self[2], 2) end

-- A failed attempt is repeated elsewhere as long as anybody else could do it.
local tried = redis.call('HGET', P .. 'tried', task)
if tried and string.find(',' .. tried .. ',', ',' .. worker .. ',', 1, true) then
  local pool = G .. 'workers:' .. stage
  local others = redis.call('ZCOUNT', pool, t - ALIVE_S, '+inf')
  local seen = {}
  for name in string.gmatch(tried, '[^,]+') do
    local seen_at = redis.call('ZSCORE', pool, name)
    if not seen[name] and seen_at and tonumber(seen_at) > t - ALIVE_S then others = others - 1 end
    seen[name] = true
  end
  if others > 0 and redis.call('HINCRBY', P .. 'rejected', task, 1) <= 20 then
    return reject('elsewhere', tried, 3)
  end
end

-- Count the attempt and take the lease.
local attempt = redis.call('HINCRBY', P .. 'attempts', task, 1)
redis.call('ZREM', P .. 'queued', task)
redis.call('HDEL', P .. 'rejected', task)
set_unit(house, unit, stage, RUNNING)
redis.call('ZADD', lease_key(stage), t + tonumber(ARGV[6]), job_of(P) .. '|' .. task)
redis.call('HSET', P .. 'claims', task, token .. '|' .. worker .. '|' .. string.format('%.3f', t))
return { 'run', tostring(attempt), inputs() }
