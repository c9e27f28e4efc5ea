-- The task is done; what follows goes to the outbox in the same step.
-- ARGV: task, token, seconds, batches, n views made, worker, sticky ("1")
-- -> {"done" | "stale", another task of the same house and stage or ""}
local task = ARGV[1]
local house, unit, stage = split(task)
local claim = redis.call('HGET', P .. 'claims', task)
if not claim or string.match(claim, '^([^|]*)|') ~= ARGV[2] then return { 'stale', '' } end
-- End the lease and note how long it took.
release(task, stage)
redis.call('HDEL', P .. 'attempts', task)
redis.call('HDEL', P .. 'tried', task)
local seconds = tonumber(ARGV[3])
redis.call('HINCRBYFLOAT', P .. 'n', 'seconds:' .. stage, string.format('%.3f', seconds))
-- Histogram over powers of two of seconds, from 1/8 s.
bump('took:' .. stage .. ':' .. math.max(-3, math.ceil(math.log(math.max(seconds, 0.125)) / math.log(2))), 1)
redis.call('HSET', G .. 'worker:' .. ARGV[6], 'streak', 0)
-- What follows becomes ready.
advance(house, unit, stage, ARGV[4])
if unit ~= '-' and house ~= '-' and not next_stage(stage) then bump('views', tonumber(ARGV[5])) end
-- Offer the worker another batch of the house it has loaded, one that never failed.
if ARGV[7] == '1' and unit ~= '-' and house ~= '-' then
  for i = 0, tonumber(redis.call('HGET', house_key(house), 'n')) - 1 do
    local at = redis.call('HGET', house_key(house), tostring(i))
    local other = task_of(house, tostring(i), stage)
    if (at == stage .. ':' .. QUEUED or at == stage .. ':' .. READY)
      and redis.call('HEXISTS', P .. 'attempts', other) == 0 then
      return { 'done', other }
    end
  end
end
return { 'done', '' }
