-- The task ended badly. ARGV: task, token, class, fingerprint, entry (JSON), worker, delay seconds,
-- cooldown seconds of an unhealthy worker
-- -> stale | handed back | retry | failed | cancelled
local task, worker = ARGV[1], ARGV[6]
local house = split(task)
local held_by = hget(P .. 'claims', task)
if not held_by or string.match(held_by, '^([^|]*)|') ~= ARGV[2] then return 'stale' end
local _, _, stage = split(task)
if SUSPECT[ARGV[3]] and redis.call('ZCOUNT', G .. 'workers:' .. stage, now() - ALIVE_S, '+inf') > 1 then
  -- Three failures in a row on different houses: the worker itself is unhealthy and cools down.
  local key = G .. 'worker:' .. worker
  if hget(key, 'streak_house') ~= house then
    hset(key, 'streak_house', house)
    if hadd(key, 'streak', 1) >= 3 then
      hset(key, 'cooling_until', now() + tonumber(ARGV[8]))
      hset(key, 'streak', 0)
    end
  end
end
return ended_badly(task, {
  class = ARGV[3], fingerprint = ARGV[4], entry = ARGV[5], worker = worker, delay = tonumber(ARGV[7]),
})
