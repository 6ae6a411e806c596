# The settings of Makefile.pipeline: what may be given, how, and what belongs together.

# Settings are texts: what looks like a variable or function of make in one, in a file's name for example, is none. They
# reach tools/pipeline.py through the environment; only RUN is expanded, by the chain. Of the shell's own variables none
# is taken: OUT, OPEN or RUN may stand there for something else.
settings := CASES VOLUMES LABELS LABEL NAMES ISOVALUE SMOOTH LARGEST FILL OPEN CUT SHELLS TOLERANCE ACCURACY OF METHOD IMAGED_AT MID_SURFACE \
  PRESSURE YOUNG POISSON THICKNESS DENSITY KIND LOAD_STEPS DURATION STEP FIX SUPPORT OUT THREADS MEM RUN BIN EXTRACT DECIMATE RELAX \
  SIMULATE MAPS CELL VESSEL DEPOSITS BALLOON
further := REPORTS CHARTS DATA PAPER HISTORY FACTOR SECONDS PARSER
misspelt := $(strip $(foreach name,$(.VARIABLES),$(if $(findstring command line,$(origin $(name))), \
  $(filter-out $(settings) $(further) MAKEFLAGS MAKEOVERRIDES,$(name)))))
# make's own variable, by which it runs what looks for the name that was meant.
override SHELL := /bin/sh
comma := ,
quoted = '$(subst ','\'',$(1))'
exported := $(strip $(foreach name,$(settings) $(further),$(if $(findstring environment,$(origin $(name))),$(name))))
$(foreach name,$(exported),$(eval override undefine $(name)))
$(if $(exported),$(shell echo 'pipeline: exported shell variables are not used: $(exported): a setting stands in the command, as in \
  $(firstword $(exported))=...' >&2))
$(foreach name,$(settings) $(further),$(if $(filter undefined,$(origin $(name))),,$(eval override $(name) := $$(value $(name)))))
nearest = $(shell python3 -E -c 'import difflib, sys; print(*difflib.get_close_matches(sys.argv[1].upper(), sys.argv[2:], 1))' \
  $(call quoted,$(1)) $(settings) $(further))
$(foreach name,$(misspelt),$(error no such variable: $(name): $(or $(patsubst %,did you mean %?,$(call nearest,$(name))), \
  make -f Makefile.pipeline help lists them)))
MAKEOVERRIDES :=

SMOOTH ?= staircase
LARGEST ?= 1
FILL ?= 1
KIND ?= static
OUT ?= out

# The sample's values are the sample's own: two vessels that the image border cuts. A user's volume has to come with
# its properties.
ifeq ($(origin VOLUMES)$(strip $(CASES))$(if $(wildcard $(root)data-samples),,installed),undefined)
  VOLUMES := $(root)data-samples/aneurysm.nii.gz $(root)data-samples/tube.nii.gz
  LABELS ?= $(if $(LABEL)$(ISOVALUE),,1)
  OPEN ?= 1
  IMAGED_AT ?= 100mmHg
  POISSON ?= 0.45
  THICKNESS ?= 1.5mm
endif

# Where it is installed there is nothing to build, and no sample.
ifeq ($(wildcard $(root)CMakeLists.txt),)
  ifneq ($(filter-out pipeline help,$(MAKECMDGOALS)),)
    $(error $(filter-out pipeline help,$(MAKECMDGOALS)): needs tunica's source: here only the pipeline is installed)
  endif
endif

ifneq ($(filter pipeline,$(or $(MAKECMDGOALS),pipeline)),)
  ifneq ($(findstring i,$(firstword -$(MAKEFLAGS)))$(findstring t,$(firstword -$(MAKEFLAGS))),)
    $(error -i and -t of make take what failed, or was never run, for done: use -k to go on past failed cases)
  endif
  # Other goals, such as the tests of this file, do not inherit what the sample sets.
  export $(settings)
endif

ifeq ($(BIN),)
  pipeline stability history charts $(scenes): build
  override BIN := $(root)build/release/bin
endif
