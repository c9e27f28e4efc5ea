-- A task that failed for good gets fresh attempts. ARGV: task -> 1 | 0 (had not failed)
local task = ARGV[1]
local house, unit, stage = split(task)
if not house then return 0 end
local at_stage, letter = unit_at(house, unit)
if at_stage ~= stage or letter ~= FAILED then return 0 end
local entry = redis.call('HGET', P .. 'failed', task)
if entry then bump('failed:' .. cjson.decode(entry).fault, -1) end
redis.call('HDEL', P .. 'failed', task)
local key = house_key(house)

-- A closed house opens again, and with it its shard and the job's reduction.
local function open_again(how)
  bump('houses:' .. how, -1)
  bump('houses:open', 1)
  redis.call('HSET', key, 's', 'open')
  local shard = math.floor(tonumber(redis.call('HGET', key, 'i'))
    / tonumber(redis.call('HGET', P .. 'job', 'shard_size')))
  if redis.call('HINCRBY', P .. 'shards', shard, 1) == 1 then
    local _, at = unit_at('-', 's' .. shard)
    if at == DONE then
      bump('done:' .. SHARD_STAGE, -1)
      redis.call('HINCRBY', P .. 'job', 'shards_left', 1)
      set_unit('-', 's' .. shard, SHARD_STAGE, CANCELLED)
    end
    local _, last = unit_at('-', '-')
    if last == DONE then
      bump('done:' .. JOB_STAGE, -1)
      set_unit('-', '-', JOB_STAGE, CANCELLED)
    end
  end
  local at_reduce, at = unit_at(house, '-')
  if at_reduce == REDUCE_STAGE and at == DONE then bump('done:' .. REDUCE_STAGE, -1) end
end

-- Count what is to end again; what a quarantine cancelled is ready once more.
local function recount()
  local left, n_failed = 0, 0
  local fields = redis.call('HGETALL', key)
  for i = 1, #fields, 2 do
    local s, at = string.match(fields[i + 1], '^(%l+):(%l)$')
    if s and fields[i] ~= '-' then
      if at == CANCELLED then
        ready(house, fields[i], s, 'RPUSH') -- what the quarantine took away
        left = left + 1
      elseif at == FAILED then
        n_failed = n_failed + 1
      elseif at ~= DONE then
        left = left + 1
      end
    end
  end
  redis.call('HSET', key, 'left', left, 'nf', n_failed)
end

if house ~= '-' then
  local how = redis.call('HGET', key, 's')
  if how ~= 'open' then open_again(how) end
end
ready(house, unit, stage, 'LPUSH')
if house ~= '-' then recount() end
-- A finished job runs again.
if redis.call('HGET', P .. 'job', 'state') == 'done' then
  redis.call('HSET', P .. 'job', 'state', 'running', 'reason', '')
  redis.call('ZADD', G .. 'jobs', redis.call('HGET', P .. 'job', 'priority'), job_of(P))
end
return 1
