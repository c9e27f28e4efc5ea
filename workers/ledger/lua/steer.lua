-- pause, resume, cancel, reduce, priority, max_slots, budget_h. ARGV: what, reason (of the last three: the number)
-- -> the job's state afterwards, "" if unknown
local state = job_field('state')
if not state then return '' end
if ARGV[1] == 'pause' then
  pause_job(ARGV[2])
elseif ARGV[1] == 'resume' and state == 'paused' then
  -- Whoever resumes a job that waits for another one does not want it to wait.
  hdel(P .. 'job', 'after')
  hset(P .. 'job', 'state', 'running')
  hset(P .. 'job', 'reason', '')
elseif ARGV[1] == 'cancel' and state ~= 'done' then
  -- What runs learns it at its next heartbeat; what is queued, when it is claimed.
  for field, value in pairs({ state = 'cancelled', reason = ARGV[2], ended = now() }) do hset(P .. 'job', field, value) end
  zset(G .. 'jobs', job_of(P), false)
  redis.call('DEL', P .. 'order', P .. 'later')
  for _, stage in ipairs(STAGES) do
    redis.call('DEL', P .. 'out:' .. stage)
  end
elseif ARGV[1] == 'max_slots' or ARGV[1] == 'budget_h' then
  hset(P .. 'job', ARGV[1], ARGV[2])
elseif ARGV[1] == 'priority' then
  -- The coordinator reads it at its next turn; a job that is over keeps it for a retry.
  hset(P .. 'job', 'priority', ARGV[2])
  redis.call('ZADD', G .. 'jobs', 'XX', ARGV[2], job_of(P))
elseif ARGV[1] == 'reduce' and state ~= 'cancelled' then
  -- Merge what is there now, unless a merge is on its way.
  local _, letter = unit_at('-', '-')
  if letter ~= READY and letter ~= QUEUED and letter ~= RUNNING then
    if letter == DONE then bump('done:' .. JOB_STAGE, -1) end
    ready('-', '-', JOB_STAGE, 'LPUSH')
    if state == 'done' then hset(P .. 'job', 'state', 'running') end
    zset(G .. 'jobs', job_of(P), job_field('priority'))
  end
end
return job_field('state')
