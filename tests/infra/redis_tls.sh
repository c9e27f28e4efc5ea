#!/usr/bin/env bash
# A Redis with TLS and an ACL user on port 6400 (or PORT), its keys in a folder; prints what to export.
#   bash tests/infra/redis_tls.sh FOLDER
set -euo pipefail
folder=$(mkdir -p "${1:?a folder}" && cd "$1" && pwd)
port=${PORT:-6400}
cd "$folder"

openssl req -x509 -newkey rsa:2048 -nodes -days 30 -subj "/CN=pbrs test CA" -keyout ca.key -out ca.crt 2>/dev/null
openssl req -newkey rsa:2048 -nodes -subj "/CN=localhost" -keyout redis.key -out redis.csr 2>/dev/null
openssl x509 -req -in redis.csr -CA ca.crt -CAkey ca.key -CAcreateserial -days 30 -out redis.crt \
  -extfile <(printf 'subjectAltName=DNS:localhost,IP:127.0.0.1') 2>/dev/null

cat >redis.conf <<CONF
port 0
tls-port $port
tls-cert-file $folder/redis.crt
tls-key-file $folder/redis.key
tls-ca-cert-file $folder/ca.crt
tls-auth-clients no
bind 127.0.0.1
dir $folder
daemonize yes
pidfile $folder/redis.pid
appendonly yes
save ""
user default off ~* &* +@all
user farm on >farmpw ~pbrs:* &* +@all -@dangerous +info +keys +scan
CONF
redis-server redis.conf
echo "export PBRS_TEST_TLS_REDIS=rediss://farm:farmpw@localhost:$port/0 PBRS_FARM_REDIS_CA=$folder/ca.crt"
echo "# stop it: kill \$(cat $folder/redis.pid)"
