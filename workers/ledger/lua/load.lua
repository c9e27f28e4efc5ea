-- One house as storage tells it. ARGV: index, house, what, groups, then unit, stage, letter each
-- what: "done" or "loaded"; letters: l (to be run), d (done)
local i, house, what, groups = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
local key = house_key(house)
if redis.call('EXISTS', key) == 1 then return 0 end
local n, left, views, n_views = 0, 0, 0, {}
for group in string.gmatch(groups, '[^;]+') do
  n_views[n] = select(2, string.gsub(group, '[^,]+', ''))
  n = n + 1
end
redis.call('HSET', key, 'i', i, 's', what)
if groups ~= '' then redis.call('HSET', P .. 'views', house, groups) end
local names = group_stages()
local opened = false
for j = 5, #ARGV, 3 do
  local unit, stage, letter = ARGV[j], ARGV[j + 1], ARGV[j + 2]
  set_unit(house, unit, stage, letter)
  if unit ~= '-' then
    opened = true
    if letter ~= 'd' then left = left + 1 else views = views + n_views[tonumber(unit)] end
    for _, name in ipairs(names) do
      if name == stage and letter ~= 'd' then break end
      bump('done:' .. name, 1)
    end
  elseif stage == 'reduce' then
    opened = true
    if letter == 'd' then bump('done:reduce', 1) end
  end
end
if views > 0 then bump('views', views) end
if opened then
  bump('done:geometry', 1)
  redis.call('HSET', key, 'n', n, 'left', left, 'nf', 0)
  bump('groups', n)
end
if what == 'done' then
  bump('houses:open', 1)
  close_house(house, 'done')
else
  redis.call('RPUSH', P .. 'order', i .. '|' .. house)
end
return 1
