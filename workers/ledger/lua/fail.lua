-- The task ended badly. ARGV: task, token, class, fingerprint, entry (JSON), worker, delay seconds,
-- cooldown seconds of an unhealthy worker
-- -> stale | handed back | retry | failed | cancelled
local task, worker = ARGV[1], ARGV[6]
local house = split(task)
local claim = redis.call('HGET', P .. 'claims', task)
if not claim or string.match(claim, '^([^|]*)|') ~= ARGV[2] then return 'stale' end
local _, _, stage = split(task)
if SUSPECT[ARGV[3]] and redis.call('ZCOUNT', G .. 'workers:' .. stage, now() - ALIVE_S, '+inf') > 1 then
  -- Three failures in a row on different houses: the worker itself is unhealthy and cools down.
  local key = G .. 'worker:' .. worker
  if redis.call('HGET', key, 'streak_house') ~= house then
    redis.call('HSET', key, 'streak_house', house)
    if redis.call('HINCRBY', key, 'streak', 1) >= 3 then
      redis.call('HSET', key, 'blocked_until', now() + tonumber(ARGV[8]), 'streak', 0)
    end
  end
end
return ended_badly(task, {
  class = ARGV[3], fingerprint = ARGV[4], entry = ARGV[5], worker = worker, delay = tonumber(ARGV[7]),
})
