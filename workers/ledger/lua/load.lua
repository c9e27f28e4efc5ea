-- Enter one house as it is in storage. ARGV: index, house, what, batches, then unit, stage, letter each
-- what: "done" or "loaded"; letters: l (to be run), d (done)
local i, house, what, batches = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
local key = house_key(house)
load_hash(key)
if hget(key, 's') then return 0 end
local n, left, views, n_views = 0, 0, 0, {}
-- Views of each batch, to count those that are done.
for batch in string.gmatch(batches, '[^;]+') do
  n_views[n] = select(2, string.gsub(batch, '[^,]+', ''))
  n = n + 1
end
hset(key, 'i', i)
hset(key, 's', what)
if batches ~= '' then hset(P .. 'views', house, batches) end
local names = batch_stages()
local opened = false
-- Enter each unit, and the stages before its own as done.
for j = 5, #ARGV, 3 do
  local unit, stage, letter = ARGV[j], ARGV[j + 1], ARGV[j + 2]
  set_unit(house, unit, stage, letter)
  if unit ~= '-' then
    opened = true
    if letter ~= DONE then left = left + 1 else views = views + n_views[tonumber(unit)] end
    for _, name in ipairs(names) do
      if name == stage and letter ~= DONE then break end
      bump('done:' .. name, 1)
    end
  elseif stage == REDUCE_STAGE then
    opened = true
    if letter == DONE then bump('done:' .. REDUCE_STAGE, 1) end
  end
end
if views > 0 then bump('views', views) end
if opened then
  bump('done:' .. GEOMETRY_STAGE, 1)
  for field, value in pairs({ n = n, left = left, nf = 0 }) do hset(key, field, value) end
  bump('batches', n)
end
-- A finished house is closed at once, any other waits to be admitted.
if what == 'done' then
  bump('houses:open', 1)
  close_house(house, 'done')
else
  push('RPUSH', P .. 'order', i .. '|' .. house)
end
return 1
