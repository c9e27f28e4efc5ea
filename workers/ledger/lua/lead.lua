-- Take or keep the lead. ARGV: own token, lease seconds -> 1 when leading
local held = redis.call('GET', G .. 'leader')
if held and held ~= ARGV[1] then return 0 end
redis.call('SET', G .. 'leader', ARGV[1], 'EX', tonumber(ARGV[2]))
return 1
