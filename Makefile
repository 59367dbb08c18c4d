# Shapemill: exemplar meshes in, verified shape datasets out.
#
#   make dataset        sets everything up, then makes the default dataset
#   make test           sets everything up, then checks style, types and tests
#   make plan           shows what it will take, before it starts
#   make help           shows every target and what the variables are set to
#
# Stages are never up to date for make: it always asks the mill, which compares fingerprints (of config, seed, code
# and inputs) with its records, and answers in a second when there is nothing to do. Times of files would
# miss an edited config and would not survive a copy.

SHELL       := bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --warn-undefined-variables --no-builtin-rules
.DELETE_ON_ERROR:
.NOTPARALLEL:  # each stage uses all WORKERS by itself
.SUFFIXES:
.DEFAULT_GOAL := help

# What a user may set, on the command line or in the environment. `make help` shows these lines.
## CONFIG   the dataset's config, a YAML file
CONFIG  ?= configs/default.yaml
## OUT      the folder that datasets are made in
OUT     ?= datasets
## WORKERS  worker processes; unless you say, one for each core
WORKERS ?=
## SEED     a seed instead of the config's
SEED    ?=
## PATIENCE minutes without progress after which a shard has failed, 0 for never; unless you say, 60
PATIENCE ?=
## CLUSTER  the scheduler of a cluster whose workers make the shards, tcp://...; unless you say, WORKERS here
CLUSTER ?=
## MESH     a model that `make inspect` looks at, or several of one kit
MESH    ?=
## PROGRAM  a shape program that `make inspect` and `recover` are about: a name, such as chair, or a module
PROGRAM ?=
## INPUT    what `make recover` looks at: a scan, a drawing, a folder of them, or a shard
INPUT   ?=
## UP       the axis of a scan that points up, x, y or z; unless you say, the one that fits
UP      ?=
## MODEL    the model that `make train` trains, by its name, or <name>-<kit>; unless you say, all of CONFIG
MODEL   ?=
## TABLE    the table that `make eval` prints, or all, for the report; without, it lists them
TABLE   ?=
## SAMPLES  how many samples `make verify` looks at by all means: a number, or all
SAMPLES ?= 100
## ROUNDS   how many rounds `make chaos` does
ROUNDS  ?= 20

# Their values are text, whatever stands in it: make expands none of it, and recipes read it from the environment, as
# "$$CONFIG", so that no shell does. A recipe never says $(CONFIG).
VARIABLES := CONFIG OUT WORKERS SEED PATIENCE CLUSTER MESH PROGRAM INPUT UP MODEL TABLE SAMPLES ROUNDS
$(foreach name,$(VARIABLES),$(eval override $(name) := $$(value $(name))))
ifeq ($(value WORKERS),)
override WORKERS := $(shell nproc 2>/dev/null || echo 1)
endif
export $(VARIABLES)
# Images of containers often ask for no compiled files; every stage and worker would then compile 400 modules anew.
unexport PYTHONDONTWRITEBYTECODE

PYTHON  := .venv/bin/python
READY   := .venv/ready-$(firstword $(shell cat requirements.lock pipeline/setup.sh pipeline/libraries.txt | cksum))
ASKED   := --config "$$CONFIG" --out "$$OUT"
SEEDED  := $${SEED:+--seed "$$SEED"}
HOW     := $(ASKED) $(SEEDED) --workers "$$WORKERS"
MODELS  := $${MODEL:+--only "$$MODEL"}
LASTS   := $${PATIENCE:+--patience "$$PATIENCE"} $${CLUSTER:+--cluster "$$CLUSTER"}
RUN      = @$(PYTHON) -m pipeline run $@ $(HOW) $(LASTS)

# The way of the data ------------------------------------------------------------------------------------------------

.PHONY: dataset autoconfig exemplars variations proportions programs grammars program_sampling shapeassembly string_sampling
.PHONY: validity abstraction strings points sketches package
dataset: package  ## Make the dataset of CONFIG in OUT: every stage, in order, from where it stands

autoconfig: setup  ## Choose what the config leaves at auto: up axis, contacts, grammar, hubs
	$(RUN)
exemplars: autoconfig  ## Read the exemplar meshes: parts, types, contacts, tiling grammar
	$(RUN)
variations: exemplars  ## Make new shapes from the exemplars' parts
	$(RUN)
proportions: exemplars  ## Make the exemplars anew in other proportions
	$(RUN)
programs: setup  ## Make new shapes from a program's parameters
	$(RUN)
grammars: setup  ## Find the shape grammar of a mesh in one piece, and make new shapes by its rules and grids
	$(RUN)
program_sampling: setup  ## Let trained models write ShapeAssembly programs
	$(RUN)
shapeassembly: program_sampling  ## Make shapes from ShapeAssembly programs, or from part hierarchies
	$(RUN)
string_sampling: exemplars  ## Make new shapes from what trained models write
	$(RUN)
validity: variations proportions programs grammars shapeassembly string_sampling  ## Judge each shape: is it rooted, does it stand?
	$(RUN)
abstraction: variations proportions programs grammars shapeassembly string_sampling  ## Find a ShapeAssembly program of each shape, if asked for
	$(RUN)
strings: variations proportions programs grammars shapeassembly string_sampling  ## Write each shape as strings, and the text corpus
	$(RUN)
points: variations proportions programs grammars shapeassembly string_sampling  ## Turn each shape into a labelled point cloud
	$(RUN)
sketches: variations proportions programs grammars shapeassembly string_sampling  ## Draw each shape as lines
	$(RUN)
package: validity abstraction strings points sketches  ## Put the dataset's folder together: shards, index, card, checksums
	$(RUN)

.PHONY: train recover
train: setup  ## Train the models of CONFIG, on the dataset's samples where they learn from these, from where they stand
	@if $(PYTHON) -m stages.training --config "$$CONFIG" $(MODELS); then $(MAKE) --no-print-directory exemplars strings; fi
	@$(PYTHON) -m pipeline run training $(HOW) $(LASTS) $(MODELS)

recover: setup  ## Find the parameters of PROGRAM, or of the likeliest program, whose shape is like INPUT
	@[ -n "$$INPUT" ] || { echo 'make recover needs INPUT=scan.ply or INPUT=drawing.png' >&2; exit 2; }
	@OMP_WAIT_POLICY=PASSIVE \
	$(PYTHON) -m stages.recovery --out "$$OUT" --program "$$PROGRAM" --up "$$UP" $(SEEDED) -- "$$INPUT"

# Looking at it ------------------------------------------------------------------------------------------------------

.PHONY: plan status verify inspect eval doctor cluster
plan: setup  ## Show the shards, samples, disk and time that the whole dataset will take, before it starts
	@$(PYTHON) -m pipeline plan $(HOW)
status: setup  ## Show what is done, failed, rejected and left
	@$(PYTHON) -m pipeline status $(HOW)
verify: setup  ## Look at the finished dataset: every file, every sample, and SAMPLES of them by all means
	@$(PYTHON) -m pipeline verify $(HOW) --samples "$$SAMPLES"
inspect: setup  ## Show what MESH can become and write a config for it, or what PROGRAM can make
	@[ -n "$$MESH$$PROGRAM" ] || { echo 'make inspect needs MESH=my.glb or PROGRAM=chair' >&2; exit 2; }
	@[ -z "$$PROGRAM" ] || $(PYTHON) -m stages.programs inspect --out "$$OUT/inspect" -- "$$PROGRAM"
	@[ -z "$$MESH" ] || $(PYTHON) -m pipeline inspect --out "$$OUT/inspect" -- "$$MESH"
eval: setup  ## Print TABLE about the finished dataset and keep it; all: every table, and a report; without: list them
	@$(PYTHON) -m eval $(ASKED) --workers "$$WORKERS" -- "$$TABLE"
cluster: setup  ## Start a cluster of WORKERS workers on this machine, for runs with the CLUSTER that it says
	@$(PYTHON) -m pipeline cluster --workers "$$WORKERS"
doctor: setup  ## Try everything that Shapemill needs on this machine, with the mend for what fails
	@$(PYTHON) -m pipeline doctor --out "$$OUT"

# Working on it ------------------------------------------------------------------------------------------------------

.PHONY: test chaos style lint bench kits keys lock
test: style  ## Check style and types and run the tests, on WORKERS cores
	@$(PYTHON) -m mypy > types.tmp & types=$$!; code=0; \
	$(PYTHON) -m pytest --numprocesses "$$WORKERS" --dist loadfile --no-loadscope-reorder || code=$$?; \
	wait "$$types" || code=$$?; cat types.tmp; rm types.tmp; exit "$$code"
chaos: setup  ## Kill, starve and spoil ROUNDS runs over the real stages, and see that each ends as it must
	$(PYTHON) -m tests.chaos --rounds "$$ROUNDS" $(SEEDED)
style: setup  ## Check style
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
lint: style  ## Check style and types
	$(PYTHON) -m mypy
bench: setup  ## Measure the whole way and every piece beside a public peer, and mark what has changed
	$(PYTHON) -m pip install -q -r tests/bench/peers.txt || echo 'some peers cannot be built here: measured without' >&2
	$(PYTHON) -m tests.bench
kits: setup  ## Write the shipped exemplars anew from their source
	$(PYTHON) datasets/exemplars/source
keys: setup  ## Write the table of all config keys, configs/README.md, anew from the code
	$(PYTHON) -m pipeline keys > configs/README.md.tmp
	mv configs/README.md.tmp configs/README.md
lock: setup  ## Choose the newest versions of everything and pin them in requirements.lock
	$(PYTHON) -m venv --clear .venv/lock
	$(PYTHON) -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	    print(*p["dependencies"], *p["optional-dependencies"]["cluster"], *p["optional-dependencies"]["dev"], sep="\n")' > .venv/lock/asked.txt
	grep '^--' requirements.lock >> .venv/lock/asked.txt
	.venv/lock/bin/python -m pip install -r .venv/lock/asked.txt
	{ grep '^[#-]' requirements.lock; .venv/lock/bin/python -m pip freeze --all --exclude pip | sed 's/+.*//'; } > lock.tmp
	mv lock.tmp requirements.lock

# The machine --------------------------------------------------------------------------------------------------------

.PHONY: setup clean help
setup: $(READY)  ## Install what is missing: system libraries, .venv, the exact versions of requirements.lock

$(READY):
	pipeline/setup.sh
	rm -f .venv/ready-*
	touch $@

clean: setup  ## Remove the work folder of CONFIG (records, shards); the finished dataset stays
	@$(PYTHON) -m pipeline clean $(ASKED)

help:  ## Show this
	@echo 'make <target> [VARIABLE=value]'
	@echo
	@sed -n 's/^\([a-z0-9_-]*\):[^#]*## \(.*\)/\1|\2/p' Makefile | while IFS='|' read -r target text; do \
	    printf '  %-13s %s\n' "$$target" "$$text"; done
	@echo
	@sed -n 's/^## \([A-Z]*\) *\(.*\)/\1|\2/p' Makefile | while IFS='|' read -r name text; do \
	    printf '  %-13s %-22s %s\n' "$$name" "$${!name:--}" "$$text"; done
