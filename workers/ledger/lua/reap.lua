-- Leases that ran out: their holders are dead or cut off. ARGV: leader token, most, lease...
-- -> number of leases ended, -1 when not leading
if not leads(ARGV[1]) then return -1 end
local t, n, own = now(), 0, P
for i = 3, #ARGV do
  local expired = redis.call('ZRANGEBYSCORE', G .. 'lease:' .. ARGV[i], '-inf', t, 'LIMIT', 0, tonumber(ARGV[2]))
  for _, member in ipairs(expired) do
    local job, task = string.match(member, '^(.-)|(.*)$')
    P = G .. '{' .. job .. '}:'
    -- The script was called without a job: work on the keys of the lease's own.
    local held_by = hget(P .. 'claims', task)
    if held_by then
      local worker = string.match(held_by, '^[^|]*|([^|]*)|')
      bump('expired', 1)
      ended_badly(task, {
        class = 'lost', fingerprint = 'lost: the worker vanished', worker = worker, delay = 0,
        entry = cjson.encode({
          fault = 'lost', fingerprint = 'lost: the worker vanished', worker = worker, log = '',
          message = 'no sign of life until the lease ran out; the worker, its node or its network died',
          attempt = tonumber(hget(P .. 'attempts', task) or '0'),
        }),
      })
    else
      zset(G .. 'lease:' .. ARGV[i], member, false)
    end
    n = n + 1
  end
end
P = own
return n
