-- The holder of leases is alive. ARGV: token, lease seconds, the task that runs, tasks it will run or has run
-- -> of the first: ok | lost | cancelled; preempted where one of them shall make room
local function is_ours(task)
  local claim = hget(P .. 'claims', task)
  return claim and string.match(claim, '^([^|]*)|') == ARGV[1]
end
local tasks = { unpack(ARGV, 3) }
hmany(P .. 'claims', tasks)
if not is_ours(tasks[1]) then return 'lost' end
if job_field('state') == 'cancelled' then return 'cancelled' end
local answer = 'ok'
for _, task in ipairs(tasks) do
  if is_ours(task) then
    if string.match(hget(P .. 'claims', task), '|p$') then answer = 'preempted' end
    local _, _, stage = split(task)
    zset(lease_key(stage), job_of(P) .. '|' .. task, now() + tonumber(ARGV[2]))
  end
end
return answer
