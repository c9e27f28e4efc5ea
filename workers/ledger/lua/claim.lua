-- May this worker run these tasks now? Of several, only those that never failed; each has its own answer.
-- ARGV: token, worker, version, recipe digest, lease seconds, direct ("1": without a message), id of the
-- worker's store ("" = not known), then tasks -> {{verdict, detail, inputs}, ...}
local c = {
  token = ARGV[1], worker = ARGV[2], version = ARGV[3], recipe = ARGV[4], lease_s = tonumber(ARGV[5]),
  direct = ARGV[6] == '1', store = ARGV[7], alone = true,
}
local tasks = { unpack(ARGV, 8) }
hmany(P .. 'attempts', tasks)
local answers = {}
for i, task in ipairs(tasks) do
  answers[i] = claim(task, c)
  -- One that failed before lets nobody run beside it, either.
  if answers[i][1] == 'run' then
    c.alone = false
    if answers[i][2] ~= '1' then c.no_more = true end
  end
end
return answers
