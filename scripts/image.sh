#!/usr/bin/env bash
# The image of docker/Dockerfile: version and revision from git, the base pinned by its digest, the SBOM copied
# to out/image/. `make image` calls it; TARGET (cpu or gpu), IMAGE, PYTHON_IMAGE and PBRS_SOURCE are variables.
set -euo pipefail
cd "$(dirname "$0")/.."
export DOCKER_BUILDKIT=1 # what `docker build` of 23.0 and later is
target=${TARGET:-cpu} base=${PYTHON_IMAGE:-python:3.11-slim-bookworm}
if [ "$target" = cpu ]; then image=${IMAGE:-pbrs-farm:latest}; else image=${IMAGE:-pbrs-farm:$target}; fi

# Of a tag, the digest that it has now; an image that no registry gave has none, and keeps its tag.
docker image inspect "$base" >/dev/null 2>&1 || docker pull -q "$base"
pinned=$(docker image inspect "$base" --format '{{if .RepoDigests}}{{index .RepoDigests 0}}{{end}}')
version=$("${PYTHON:-.venv/bin/python}" -m setuptools_scm)
docker build -f docker/Dockerfile --target "$target" -t "$image" \
  --build-arg "PYTHON_IMAGE=${pinned:-$base}" --build-arg "PBRS_VERSION=$version" \
  --build-arg "PBRS_REVISION=$(git rev-parse HEAD)" --build-arg "PBRS_SOURCE=${PBRS_SOURCE:-}" .
mkdir -p out/image
docker run --rm --entrypoint cat "$image" /opt/venv/sbom.cdx.json >out/image/sbom.cdx.json
docker image inspect "$image" --format '{{json .Config.Labels}}' >out/image/labels.json
echo "$image: $(($(docker image inspect "$image" --format '{{.Size}}') / 1000000)) MB, version $version; out/image/sbom.cdx.json"
