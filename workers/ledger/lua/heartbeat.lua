-- The holder of a lease is alive. ARGV: task, token, lease seconds -> ok | lost | cancelled | paused
local task = ARGV[1]
local claim = redis.call('HGET', P .. 'claims', task)
if not claim or string.match(claim, '^([^|]*)|') ~= ARGV[2] then return 'lost' end
local state = redis.call('HGET', P .. 'job', 'state')
if state == 'cancelled' then return 'cancelled' end
local _, _, stage = split(task)
redis.call('ZADD', lease_key(stage), 'XX', now() + tonumber(ARGV[3]), job_of(P) .. '|' .. task)
return 'ok'
