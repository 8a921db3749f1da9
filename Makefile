# Colonnade. `make setup` once (every target calls it), then `make render` or `make test`.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup render test test-hardware test-host verify paper bench soc live browser check docs release release-check container lock format clean

venv := .venv/bin
SCENE ?= scenes/metal.toml
CONFIG ?= small
SIZE ?= 640x480
SAMPLES ?= 4
BENCH_CONFIG ?= edge

help: ## what the targets do
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' Makefile | expand -t 24

setup: ## install whatever is missing: system programs, .venv, sbt
	@tools/setup

render: ## render SCENE through the RTL of CONFIG at SIZE with SAMPLES a pixel into out/render.png, the first one into out/preview.png
	@tools/setup --render '$(CONFIG)'
	@mkdir -p out
	@$(venv)/colonnade render $(SCENE) --config $(CONFIG) --backend rtl --size $(SIZE) --samples $(SAMPLES) --preview out/preview.png --output out/render.png --json out/render.json

test: ## the hardware's specs (sbt test) and the host's tests (pytest)
	@tools/test

test-hardware: ## only sbt test
	@tools/test hardware

test-host: ## only pytest
	@tools/test host

verify: setup ## the full matrix: array shapes, precisions, meshes; long
	@tools/verify

paper: setup ## each claim of the source paper in a cheap form against docs/paper.md, and out/paper/index.html; FULL=1 takes hours
	@tools/paper $(if $(FULL),--full)

bench: setup ## rays per cycle of the benchmark meshes, and out/bench.png: where the cycles go
	@mkdir -p out
	@$(venv)/colonnade bench --config $(BENCH_CONFIG) --json out/bench.json --plot out/bench.png

soc: setup ## a LiteX SoC in the simulator: boots, computes views, renders by the driver, compares with the model
	@tools/soc

live: setup ## objects that move in a room, a mirror before a moving camera: videos, time, energy, out/live/index.html
	@$(venv)/python tools/live

browser: setup ## the packer and the model as one HTML file, out/browser/index.html
	@tools/environment zig
	@$(venv)/python tools/browser

check: setup ## formatters, linters, types, layers, derived files
	@tools/check

docs: setup ## the documentation site in out/site; fails on a broken link
	@tools/docs

release: ## wheels, the generator as a jar, designs of all presets, site, bill of materials and checksums in out/release
	@tools/release

release-check: ## make the release twice, compare, and use its files in bare systems; as root, long
	@tools/release-check

container: ## the image `colonnade`: Debian 12, a checkout that is set up; by podman, buildah or docker
	@tools/container

lock: setup ## make host/locks and project/dependencies.sha256 again
	@tools/lock

format: setup ## let the formatters rewrite the sources
	@tools/environment lint
	@git ls-files '*.c' '*.h' '*.cpp' '*.hpp' | xargs .cache/lint-environment/bin/clang-format -i
	@.cache/lint-environment/node_modules/.bin/biome format --write .
	@tools/sbt scalafmtAll
	@$(venv)/ruff check --fix --select I host lab
	@$(venv)/ruff format host lab
	@$(venv)/ruff format --config host/pyproject.toml tools/usage.py tools/host_python.py tools/supply_chain tools/site tools/browser tools/diagrams tools/layers-* tools/vocabulary tools/frame-digests tools/mutations tools/unit-bench tools/distribution tools/configuration-keys tools/lines tools/starting-pages tools/doors tools/ray-suites tools/ray_suites

clean: ## remove everything that was built, fetched or cached
	@rm -rf .venv .tools .cache out target project/target project/project test_run_dir build host/build
