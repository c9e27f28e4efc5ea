-- Messages that seem lost: sent long ago, still unclaimed. ARGV: leader token, stage, age seconds, most
-- -> tasks to send again, or "not leading"
if not leads(ARGV[1]) then return 'not leading' end
local t, again = now(), {}
for _, task in ipairs(redis.call('ZRANGEBYSCORE', P .. 'queued', '-inf', t - tonumber(ARGV[3]), 'LIMIT', 0, tonumber(ARGV[4]))) do
  local house, unit, stage = split(task)
  local at_stage, letter = unit_at(house, unit)
  if at_stage ~= stage or letter ~= QUEUED then
    zset(P .. 'queued', task, false)
  elseif stage == ARGV[2] then
    zset(P .. 'queued', task, t)
    again[#again + 1] = task
  end
end
return again
