# Shapemill: exemplar meshes in, verified shape datasets out.
#
#   make dataset        sets everything up, then makes the default dataset
#   make test           sets everything up, then checks style, types and tests
#   make plan           shows what it will take, before it starts
#   make help           shows every target and what the variables are set to
#
# No stage is ever up to date for make: the engine compares fingerprints (of config, seed, code and inputs) with its
# records, and answers in a second when there is nothing to do. Times of files would miss an edited config and would
# not survive a copy.

SHELL       := bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --warn-undefined-variables --no-builtin-rules
.DELETE_ON_ERROR:
.NOTPARALLEL:  # each stage uses all WORKERS by itself
.SUFFIXES:
.DEFAULT_GOAL := help

# What a user may set, on the command line or in the environment. `make help` shows these lines.
## CONFIG   config of the dataset, a YAML file
CONFIG  ?= configs/default.yaml
## OUT      folder that datasets are written to
OUT     ?= datasets
## WORK     folder of records and shards where OUT is a URL, such as s3://bucket/prefix; datasets if empty
WORK    ?=
## WORKERS  number of worker processes; one for each core if empty
WORKERS ?=
## SEED     seed in place of the config's
SEED    ?=
## STALL_TIMEOUT minutes without progress after which a shard fails, 0 for never; 60 if empty
STALL_TIMEOUT ?=
## CLUSTER  scheduler of a cluster whose workers make the shards, tcp://...; WORKERS of this machine if empty
CLUSTER ?=
## MESH     a model, or several of one kit, for `make inspect`; these or a folder for `make dataset` and some tables
MESH    ?=
## PROGRAM  shape program for `make inspect` and `recover`: a name, such as chair, or a module
PROGRAM ?=
## INPUT    input of `make recover`: a scan, a drawing, a folder of them, or a shard
INPUT   ?=
## UP       axis of a scan that points up, x, y or z; the best fit if empty
UP      ?=
## MODEL    model for `make train`: its name, or <name>-<kit>; all of CONFIG if empty
MODEL   ?=
## TABLE    table for `make eval`, or all, for the report; lists the tables if empty
TABLE   ?=
## PAPER    paper for `make paper`: strings, shapeassembly, substructures, symmetry, geocode or all; lists them if empty
PAPER   ?=
## SCALE    how much `make paper` makes: minutes, hours or full
SCALE   ?= minutes
## SAMPLES  samples that `make verify` checks by independent means: a number, or all
SAMPLES ?= 100
## FORMAT   format of `make export`: urdf, mjcf, usd or obj
FORMAT  ?=
## KEY      keys of the samples that `make export` writes, with commas between; all if empty
KEY     ?=
## DEST     where `make publish` puts the dataset: a folder, s3://bucket/name or hf://organization/name
DEST    ?=
## DRY_RUN  1 for a `make publish` that lists what would be sent, and sends nothing
DRY_RUN ?=
## SHARD    shard that `make reproduce` makes again, such as train-000007
SHARD   ?=
## ROUNDS   rounds of `make chaos`
ROUNDS  ?= 20
## VERSION  version that `make release` makes, such as 0.2.0
VERSION ?=

# Their values are text: make expands none of it, and recipes read it from the environment, as "$$CONFIG", so that no
# shell expands it either. A recipe never says $(CONFIG).
VARIABLES := CONFIG OUT WORK WORKERS SEED STALL_TIMEOUT CLUSTER MESH PROGRAM INPUT UP MODEL TABLE PAPER SCALE SAMPLES \
             FORMAT KEY DEST DRY_RUN SHARD ROUNDS VERSION
$(foreach name,$(VARIABLES),$(eval override $(name) := $$(value $(name))))
ifeq ($(value WORKERS),)
override WORKERS := $(shell nproc 2>/dev/null || echo 1)
endif
export $(VARIABLES)
# Images of containers often ask for no compiled files; every stage and worker would then compile 400 modules again.
unexport PYTHONDONTWRITEBYTECODE
# `python -m pipeline` finds the project in the working folder, and text is UTF-8 in every locale.
unexport PYTHONSAFEPATH
export PYTHONUTF8 := 1

PYTHON    := .venv/bin/python
SHAPEMILL := $(PYTHON) -m pipeline
LOCKED    := $(firstword $(shell cat requirements.lock pyproject.toml pipeline/setup.sh pipeline/libraries.txt | cksum))
READY     := .venv/ready-$(LOCKED)
DATASET   := --config "$$CONFIG" --out "$$OUT"
SEEDED    := $${SEED:+--seed "$$SEED"}
OPTIONS   := $(DATASET) $(SEEDED) --workers "$$WORKERS"
RUNNING   := $${STALL_TIMEOUT:+--stall-timeout "$$STALL_TIMEOUT"} $${CLUSTER:+--cluster "$$CLUSTER"}
STORING   := $${WORK:+--work "$$WORK"}
RUN        = @$(SHAPEMILL) run $@ $(OPTIONS) $(RUNNING) $(STORING)

# Making datasets ----------------------------------------------------------------------------------------------------

.PHONY: dataset autoconfig exemplars variations proportions programs grammars program_sampling shapeassembly
.PHONY: string_sampling primitives mixture validity abstraction strings points sketches views surface structure
.PHONY: captions exports package
dataset: setup  ## Make the dataset of CONFIG in OUT, with MESH in place of its kits: whatever is missing or outdated
	@FOLDER=$$OUT; case "$$OUT" in *://*) FOLDER=$${WORK:-datasets};; esac; \
	[ -z "$$MESH" ] || { CONFIG=$$($(SHAPEMILL) with-models --config "$$CONFIG" --out "$$FOLDER" -- "$$MESH"); \
	  echo "config: $$CONFIG"; }; \
	$(SHAPEMILL) run $(OPTIONS) $(RUNNING) $(STORING)

autoconfig: setup  ## Choose the settings that the config leaves at auto: up axis, contacts, grammar, hubs
	$(RUN)
exemplars: autoconfig  ## Read the exemplar meshes: parts, types, contacts, tiling grammar
	$(RUN)
variations: exemplars  ## Make new shapes from the exemplars' parts
	$(RUN)
proportions: exemplars  ## Resize the exemplars to other proportions
	$(RUN)
programs: setup  ## Sample shapes from a parametric program
	$(RUN)
grammars: setup  ## Find the shape grammar of a mesh in one piece, and derive new shapes from it
	$(RUN)
program_sampling: setup  ## Sample ShapeAssembly programs from trained models
	$(RUN)
shapeassembly: program_sampling  ## Make shapes from ShapeAssembly programs, or from part hierarchies
	$(RUN)
string_sampling: exemplars  ## Sample strings from trained models, and make shapes of them
	$(RUN)
primitives: setup  ## Make heaps, stacks and attached compositions of simple solids
	$(RUN)
PRODUCERS := variations proportions programs grammars shapeassembly string_sampling primitives
mixture: $(PRODUCERS)  ## Join the samples of several producers, if the config asks for it
	$(RUN)
validity: mixture  ## Check each shape: is it rooted, is it stable?
	$(RUN)
abstraction: mixture  ## Find a ShapeAssembly program of each shape, if the config asks for it
	$(RUN)
strings: mixture  ## Write each shape as strings, and the text corpus
	$(RUN)
points: mixture  ## Sample a labelled point cloud of each shape
	$(RUN)
sketches: mixture  ## Draw each shape as lines
	$(RUN)
views: mixture  ## Render images of each shape, if the config has cameras
	$(RUN)
surface: mixture  ## Find what is true of surfaces, unions, signed distances and occupancy, if the config asks
	$(RUN)
structure: mixture  ## Find hierarchies and symmetries of shapes, if the config asks
	$(RUN)
captions: validity  ## Describe each shape in words, if the config asks for it
	$(RUN)
exports: validity  ## Write files of simulators for each sample, if the config asks for it
	$(RUN)
package: validity abstraction strings points sketches views surface structure captions exports  ## Write the dataset's folder: shards, index, card, checksums
	$(RUN)

.PHONY: train recover export publish
train: setup-models  ## Train the models of CONFIG, after making the samples that they learn from
	@$(SHAPEMILL) train $(OPTIONS) $(RUNNING) $${MODEL:+--only "$$MODEL"}
recover: setup-models  ## Find the parameters of PROGRAM, or of the likeliest program, that give the shape of INPUT
	@[ -n "$$INPUT" ] || { echo 'make recover needs INPUT=scan.ply or INPUT=drawing.png' >&2; exit 2; }
	@OMP_WAIT_POLICY=PASSIVE $(SHAPEMILL) recover --out "$$OUT" --program "$$PROGRAM" --up "$$UP" $(SEEDED) -- "$$INPUT"

export: setup  ## Write samples of the finished dataset as FORMAT, for simulators and modelling programs
	@[ -n "$$FORMAT" ] || { echo 'make export needs FORMAT=urdf, mjcf, usd or obj' >&2; exit 2; }
	@$(SHAPEMILL) export $(DATASET) --key "$$KEY" -- "$$FORMAT"

publish: setup-stores  ## Put the finished, verified dataset at DEST, where people load it
	@[ -n "$$DEST" ] || { echo 'make publish needs DEST=s3://bucket/name, hf://organization/name or a folder' >&2; exit 2; }
	@$(SHAPEMILL) publish $(DATASET) $${DRY_RUN:+--dry-run} -- "$$DEST"

# Looking at them ----------------------------------------------------------------------------------------------------

.PHONY: plan status verify reproduce inspect eval paper doctor cluster
plan: setup  ## Estimate shards, samples, disk and time of the dataset, before it starts
	@$(SHAPEMILL) plan $(OPTIONS)
status: setup  ## Show what is done, failed, rejected and left
	@$(SHAPEMILL) status $(OPTIONS)
verify: setup  ## Check the finished dataset: every file, every sample, and SAMPLES of them by independent means
	@$(SHAPEMILL) verify $(OPTIONS) --samples "$$SAMPLES"
reproduce: setup  ## Make one SHARD of the finished dataset again, from its manifest alone, and compare the bytes
	@$(SHAPEMILL) reproduce $(DATASET) --workers "$$WORKERS" -- "$$SHARD"
inspect: setup  ## Show what can be made of MESH and write a config for it, or what PROGRAM can make
	@[ -n "$$MESH$$PROGRAM" ] || { echo 'make inspect needs MESH=my.glb or PROGRAM=chair' >&2; exit 2; }
	@[ -z "$$PROGRAM" ] || $(SHAPEMILL) programs inspect --out "$$OUT/inspect" -- "$$PROGRAM"
	@[ -z "$$MESH" ] || $(SHAPEMILL) inspect --out "$$OUT/inspect" -- "$$MESH"
eval: setup-models  ## Print TABLE about the finished dataset and keep it; all: every table, and a report; empty: list them
	@$(SHAPEMILL) eval $(DATASET) --workers "$$WORKERS" -- "$$TABLE" $${MESH:+"$$MESH"}
paper: setup-models  ## Make what the tables and figures of PAPER need at SCALE, and one report of them
	@$(SHAPEMILL) paper --scale "$$SCALE" --out "$$OUT" --workers "$$WORKERS" -- "$$PAPER"
cluster: setup-cluster  ## Start a cluster of WORKERS workers on this machine, and print the CLUSTER of its scheduler
	@$(SHAPEMILL) cluster --workers "$$WORKERS"
doctor: setup  ## Try everything that Shapemill needs on this machine, with the remedy for what fails
	@$(SHAPEMILL) doctor --out "$$OUT"

# Working on it ------------------------------------------------------------------------------------------------------

.PHONY: test chaos style lint bench kits kernels config-docs results release lock
# One process more than cores: some tests wait, for files, for a time-out, for a process that starts.
test: style  ## Check style and types and run the tests, on WORKERS cores
	@$(PYTHON) -m mypy > types.tmp & types=$$!; code=0; \
	$(PYTHON) -m pytest --numprocesses "$$((WORKERS + 1))" --dist loadfile --no-loadscope-reorder || code=$$?; \
	wait "$$types" || code=$$?; cat types.tmp; rm types.tmp; exit "$$code"
chaos: setup-dev  ## Kill runs and corrupt their files in ROUNDS rounds, and check how each ends
	$(PYTHON) -m tests.chaos --rounds "$$ROUNDS" $(SEEDED)
style: setup-dev  ## Check style
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
lint: style  ## Check style and types
	$(PYTHON) -m mypy
bench: setup-dev  ## Measure every stage and every piece against a public peer, and mark what has changed
	$(PYTHON) -m pip install -q -r tests/bench/peers.txt || echo 'some peers cannot be built here: measured without' >&2
	$(PYTHON) -m tests.bench
kits: setup  ## Write the shipped exemplars from their source
	$(PYTHON) datasets/exemplars/source
kernels: setup  ## Record the kernels that stages use, which a first run compiles ahead
	$(PYTHON) -m pipeline.make_kernel_list .venv/kernels configs/default.yaml
config-docs: setup  ## Write the tables of config keys in configs/sections from the code
	$(SHAPEMILL) config-docs
results: setup  ## Write eval/RESULTS.md and RESULTS.html from eval/papers
	$(SHAPEMILL) results
release: setup  ## Join the fragments of changes/ into the changelog, set VERSION and tag it
	$(PYTHON) changes/release.py "$$VERSION"
lock: setup-dev  ## Choose the newest versions of everything and pin them in requirements.lock
	$(PYTHON) -m venv --clear .venv/lock
	$(PYTHON) -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	    print(*p["dependencies"], *sum(p["optional-dependencies"].values(), []), sep="\n")' > .venv/lock/asked.txt
	grep '^--' requirements.lock >> .venv/lock/asked.txt
	.venv/lock/bin/python -m pip install -r .venv/lock/asked.txt
	{ grep '^[#-]' requirements.lock; .venv/lock/bin/python -m pip freeze --all --exclude pip | sed 's/+.*//'; } > lock.tmp
	mv lock.tmp requirements.lock

# The machine --------------------------------------------------------------------------------------------------------

.PHONY: setup setup-models setup-cluster setup-stores setup-dev clean help
setup: $(READY)/core  ## Install what datasets need: system libraries, .venv, pinned packages
setup-models: $(READY)/models  ## Add what models need: torch
setup-cluster: $(READY)/cluster  ## Add what a cluster needs: dask
setup-stores: $(READY)/stores  ## Add what object stores need: s3fs and huggingface_hub
setup-dev: $(READY)/dev  ## Add what tests and benchmarks need, and the groups above

$(READY)/core:
	pipeline/setup.sh
	rm -rf .venv/ready-*
	mkdir $(READY)
	touch $@
$(READY)/models $(READY)/cluster $(READY)/stores: | $(READY)/core
	pipeline/setup.sh $(@F)
	touch $@
$(READY)/dev:
	pipeline/setup.sh models cluster stores dev
	rm -rf .venv/ready-*
	mkdir $(READY)
	touch $(addprefix $(READY)/,core models cluster stores dev)

clean: setup  ## Delete the work folder of CONFIG (records, shards); the finished dataset stays
	@$(SHAPEMILL) clean $(DATASET)

help:  ## Show this
	@echo 'make <target> [VARIABLE=value]'
	@echo
	@sed -n 's/^\([a-z0-9_-]*\):[^#]*## \(.*\)/\1|\2/p' Makefile | while IFS='|' read -r target text; do \
	    printf '  %-16s %s\n' "$$target" "$$text"; done
	@echo
	@sed -n 's/^## \([A-Z_]*\) *\(.*\)/\1|\2/p' Makefile | while IFS='|' read -r name text; do \
	    printf '  %-16s %-22s %s\n' "$$name" "$${!name:--}" "$$text"; done
