-- Moves due and ready tasks towards the queues. ARGV: leader token, most open houses, then pairs of
-- stage and how many of it may be sent -> {tasks to send...}, or "not leading"
if not leads(ARGV[1]) then return 'not leading' end
local t = now()
-- What waited for its time is ready now.
for _, task in ipairs(redis.call('ZRANGEBYSCORE', P .. 'later', '-inf', t, 'LIMIT', 0, 500)) do
  local house, unit, stage = split(task)
  zset(P .. 'later', task, false)
  local at_stage, letter = unit_at(house, unit)
  if at_stage == stage and letter == READY then push('LPUSH', P .. 'out:' .. stage, task) end
end
local running = job_field('state') == 'running'

-- Admit houses, in order, while few are open.
local open = count('houses:open')
local admitted = 0
while running and open < tonumber(ARGV[2]) and admitted < 200 do
  local entry = redis.call('LPOP', P .. 'order')
  if not entry then break end
  local i, house = string.match(entry, '^(%d+)|(.*)$')
  local key = house_key(house)
  load_hash(key)
  local known = hget(key, 's')
  if not known then
    -- A fresh house begins with its geometry.
    hset(key, 'i', i)
    hset(key, 's', 'open')
    ready(house, '-', GEOMETRY_STAGE, 'RPUSH')
    open = open + 1
    bump('houses:open', 1)
  elseif known == 'loaded' then
    -- A house storage knows goes on where it was.
    hset(key, 's', 'open')
    local units = {}
    for unit, at in pairs(hall(key)) do
      local stage, letter = string.match(at, '^(%l+):(%l)$')
      if letter == LOADED then units[#units + 1] = { unit, stage } end
    end
    table.sort(units, function(a, b) return (tonumber(a[1]) or -1) < (tonumber(b[1]) or -1) end)
    for _, at in ipairs(units) do ready(house, at[1], at[2], 'RPUSH') end
    open = open + 1
    bump('houses:open', 1)
  end
  admitted = admitted + 1
end

-- Take from the outbox what there is room for on the queues; what became ready above is in it by then.
flush()
local sent = {}
for i = 3, #ARGV, 2 do
  local stage, room = ARGV[i], tonumber(ARGV[i + 1])
  while room > 0 and (running or stage == JOB_STAGE) do
    local batch = redis.call('LPOP', P .. 'out:' .. stage, room)
    if not batch then break end
    for _, task in ipairs(batch) do
      local house, unit = split(task)
      local at_stage, letter = unit_at(house, unit)
      -- Anything else was cancelled, or taken without a message.
      if at_stage == stage and letter == READY then
        set_unit(house, unit, stage, QUEUED)
        zset(P .. 'queued', task, t)
        sent[#sent + 1] = task
        room = room - 1
      end
    end
  end
end
return sent
