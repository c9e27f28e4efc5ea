-- Tasks that shall end at their next heartbeat, for an urgent job. ARGV: leader token, then pairs of task
-- and the token that holds it -> how many shall that did not before, -1 when not leading
if not leads(ARGV[1]) then return -1 end
local n = 0
for i = 2, #ARGV, 2 do
  local claim = hget(P .. 'claims', ARGV[i])
  if claim and string.match(claim, '^([^|]*)|') == ARGV[i + 1] and not string.match(claim, '|p$') then
    hset(P .. 'claims', ARGV[i], claim .. '|p')
    n = n + 1
  end
end
return n
