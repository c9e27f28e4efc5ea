-- A task that failed for good gets fresh attempts. ARGV: task -> 1 | 0 (had not failed)
local task = ARGV[1]
local house, unit, stage = split(task)
if not house then return 0 end
local at_stage, letter = unit_at(house, unit)
if at_stage ~= stage or letter ~= FAILED then return 0 end
local entry = hget(P .. 'failed', task)
if entry then bump('failed:' .. cjson.decode(entry).fault, -1) end
hdel(P .. 'failed', task)
local key = house_key(house)

-- A closed house opens again, and with it its shard and the job's reduction.
local function open_again(how)
  bump('houses:' .. how, -1)
  bump('houses:open', 1)
  hset(key, 's', 'open')
  local shard = math.floor(tonumber(hget(key, 'i')) / tonumber(job_field('shard_size')))
  if hadd(P .. 'shards', shard, 1) == 1 then
    local _, at = unit_at('-', 's' .. shard)
    if at == DONE then
      bump('done:' .. SHARD_STAGE, -1)
      hadd(P .. 'job', 'shards_left', 1)
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
  for number, value in pairs(hall(key)) do
    local s, at = string.match(value, '^(%l+):(%l)$')
    if s and number ~= '-' then
      if at == CANCELLED then
        ready(house, number, s, 'RPUSH') -- what the quarantine took away
        left = left + 1
      elseif at == FAILED then
        n_failed = n_failed + 1
      elseif at ~= DONE then
        left = left + 1
      end
    end
  end
  hset(key, 'left', left)
  hset(key, 'nf', n_failed)
end

if house ~= '-' then
  local how = hget(key, 's')
  if how ~= 'open' then open_again(how) end
end
ready(house, unit, stage, 'LPUSH')
if house ~= '-' then recount() end
-- A finished job runs again.
if job_field('state') == 'done' then
  hset(P .. 'job', 'state', 'running')
  hset(P .. 'job', 'reason', '')
  zset(G .. 'jobs', job_of(P), job_field('priority'))
end
return 1
