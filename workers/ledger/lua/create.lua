-- A job appears, unless it is there. ARGV: n_houses, shard size, then name and value of fields
-- -> state of the job before ("" = created now)
local state = job_field('state')
if state then return state end
local n, size = tonumber(ARGV[1]), tonumber(ARGV[2])
local shards = math.max(1, math.ceil(n / size))
redis.call('HSET', P .. 'job', unpack(ARGV, 3))
redis.call('HSET', P .. 'job', 'state', 'loading', 'reason', '', 'created', now(), 'n_houses', n,
  'shard_size', size, 'shards_left', shards)
-- Houses still open in each shard.
for s = 0, shards - 1 do
  redis.call('HSET', P .. 'shards', s, math.min(size, n - s * size))
end
return ''
