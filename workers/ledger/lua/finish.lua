-- Tasks are done; what follows goes to the outbox in the same step, or to this very worker.
-- ARGV: token, worker, n, then n times task, seconds, batches, views made; then, where the worker will go on,
-- version, recipe digest, lease seconds, id of its store, seconds that are worth a claim, queues it takes (a,b),
-- and "1" after a task so long that the scene it loaded is worth another one
-- -> {{"done" | "stale", ...}, {task, verdict, detail, inputs, task, ...} claimed now}
local token, worker, n = ARGV[1], ARGV[2], tonumber(ARGV[3])
local verdicts, tasks, last, spent = {}, {}, nil, 0
for i = 1, n do tasks[i] = ARGV[4 * i] end
for _, name in ipairs({ 'claims', 'attempts' }) do hmany(P .. name, tasks) end
-- From the last to the first, so that what follows the first stands before the others.
for i = n, 1, -1 do
  local task = tasks[i]
  local house, unit, stage = split(task)
  local claim = hget(P .. 'claims', task)
  if not claim or string.match(claim, '^([^|]*)|') ~= token then
    verdicts[i] = 'stale'
  else
    verdicts[i], last = 'done', { house = house, stage = stage }
    -- End the lease and note how long it took.
    release(task, stage)
    if tonumber(hget(P .. 'attempts', task) or '1') > 1 then hdel(P .. 'tried', task) end
    hdel(P .. 'attempts', task)
    local seconds = tonumber(ARGV[4 * i + 1])
    bump('seconds:' .. stage, seconds)
    spent = spent + seconds
    bump('timed:' .. stage, 1)
    -- Histogram over powers of two of seconds, from 1/8 s.
    bump('took:' .. stage .. ':' .. math.max(-3, math.ceil(math.log(math.max(seconds, 0.125)) / math.log(2))), 1)
    -- What follows becomes ready.
    advance(house, unit, stage, ARGV[4 * i + 2])
    if unit ~= '-' and house ~= '-' and not next_stage(stage) then bump('views', tonumber(ARGV[4 * i + 3])) end
  end
end
-- What a user's tasks took, by day.
local user = job_field('user') or ''
if user ~= '' and spent > 0 then
  redis.call('HINCRBYFLOAT', G .. 'spent:' .. math.floor(now() / 86400), user, string.format('%.3f', spent))
end
if last then
  local self = G .. 'worker:' .. worker
  hmany(self, { 'drain', 'cooling_until', 'streak', 'queues' })
  if hget(self, 'streak') ~= '0' then hset(self, 'streak', 0) end
end
local at = 4 * n + 4
if not last or last.house == '-' or not ARGV[at] then return { verdicts, {} } end

-- What this worker may go on with: of the house it has loaded, what never failed.
local queues = {}
for queue in string.gmatch(ARGV[at + 5], '[^,]+') do queues[#queues + 1] = queue end
local function takes(stage)
  local queue = stage
  if stage == LIGHT_STAGE and job_field('gpu') == '1' then queue = GPU_LEASE end
  for _, name in ipairs(queues) do
    if name == queue then return true end
  end
  return false
end
-- Others have enough to do: a message waits on a queue that this worker takes from.
local function others_are_busy()
  for _, queue in ipairs(queues) do
    if redis.call('LLEN', G .. queue) > 0 then return true end
  end
  return false
end
-- The units of the house that wait at a stage, by number.
local function waiting(stage, letters)
  local found = {}
  for unit, value in pairs(hall(house_key(last.house))) do
    local s, letter = string.match(value, '^(%l+):(%l)$')
    local is_batch = stage ~= REDUCE_STAGE and unit ~= '-'
    if s == stage and letters[letter] and (is_batch or (stage == REDUCE_STAGE and unit == '-')) then
      found[#found + 1] = unit
    end
  end
  table.sort(found, function(a, b) return (tonumber(a) or -1) < (tonumber(b) or -1) end)
  local names = {}
  for i, unit in ipairs(found) do names[i] = task_of(last.house, unit, stage) end
  hmany(P .. 'attempts', names)
  local fresh = {}
  for _, name in ipairs(names) do
    if not hget(P .. 'attempts', name) then fresh[#fresh + 1] = name end
  end
  return fresh
end
-- How many tasks of a stage are worth so many seconds, by those that were timed; one while none was.
local function worth(stage, seconds)
  local timed = count('timed:' .. stage)
  if timed < 1 then return 1 end
  return math.max(1, math.min(MOST_TOGETHER, math.floor(seconds / math.max(count('seconds:' .. stage) / timed, 0.001))))
end

local chosen = {}
if ARGV[at + 6] == '1' then
  local found = waiting(last.stage, { [QUEUED] = true, [READY] = true })
  if last.stage ~= REDUCE_STAGE and last.stage ~= GEOMETRY_STAGE then chosen = { found[1] } end
elseif others_are_busy() then
  -- The last stage first, so that houses end.
  local stages = batch_stages()
  stages[#stages + 1] = REDUCE_STAGE
  for i = #stages, 1, -1 do
    local found = takes(stages[i]) and waiting(stages[i], { [READY] = true }) or {}
    if #found > 0 then
      for k = 1, math.min(#found, worth(stages[i], tonumber(ARGV[at + 4]))) do chosen[k] = found[k] end
      break
    end
  end
end
local c = {
  token = token, worker = worker, version = ARGV[at], recipe = ARGV[at + 1], lease_s = tonumber(ARGV[at + 2]),
  direct = true, store = ARGV[at + 3], alone = false,
}
local claimed = {}
for _, task in ipairs(chosen) do
  local answer = claim(task, c)
  if answer[1] == 'run' then
    for _, value in ipairs({ task, unpack(answer) }) do claimed[#claimed + 1] = value end
  end
end
return { verdicts, claimed }
