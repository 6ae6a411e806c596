# The stages of the cases that tools/pipeline.py has planned, run by it in the folder of its plan (described there). No
# name of a file stands here: a case is a folder with a harmless name, and what is run stands quoted in its files.

cases := $(file < cases)

# $(THREADS) stands in RUN, too.
jobs = $(if $(filter -j%,$(MAKEFLAGS)),$(or $(patsubst -j%,%,$(filter -j%,$(MAKEFLAGS))),$(words $(cases))),1)
ifeq ($(THREADS),)
  THREADS := $(shell n=$$(( $$(nproc) / $(jobs) )); echo $$(( n > 1 ? n : 1 )))
endif

.PHONY: all
.DELETE_ON_ERROR:
.SUFFIXES:
all: $(cases:=/done)

# A tool that is missing is no error of make: a dry run may come before the build.
bin/%: ;

files_extract := surface.ply
files_decimate := coarse.ply
files_relax := shell.ply map.png
files_simulate := result.hdf picture.png refined.ply
from_simulate := simulate
from_relax := relax $(from_simulate)
from_decimate := decimate $(from_relax)
from_extract := extract $(from_decimate)

# $(call stage,case,stage): removes what this stage and the later ones left, notes what this one depends on and when it
# began, runs the command where the user stands, and keeps its exit code: none is left by one that was killed.
define stage
	@echo '$(1): $(2)' || :
	@: > $(1)/$(2).exit; rm -f $(foreach later,$(from_$(2)),$(addprefix $(1)/out/,$(files_$(later)) $(later).json \
	  $(later).log .$(later).flags)) && cp $(1)/$(2).flags $(1)/out/.$(2).flags
	@( cd "$$TUNICA_FROM" && $(RUN) $(file < $(1)/$(2).command) --threads $(THREADS) ) 2> $(1)/out/$(2).log; code=$$?; \
	  echo $$code > $(1)/$(2).exit; [ $$code = 0 ] || cat $(1)/out/$(2).log >&2; exit $$code
endef

# $(call rules,case)
define rules
$(addprefix $(1)/out/,surface.ply coarse.ply shell.ply result.hdf): MEM := $$(file < $(1)/mem)

$(1)/done: $(1)/out/result.hdf
	@touch $$@

$(1)/out/surface.ply: $(1)/extract.flags bin/tunica-extract
	$$(call stage,$(1),extract)

$(1)/out/coarse.ply: $(1)/out/surface.ply $(1)/decimate.flags bin/tunica-decimate
	$$(call stage,$(1),decimate)

$(1)/out/shell.ply: $(1)/out/coarse.ply $(1)/relax.flags bin/tunica-relax
	$$(call stage,$(1),relax)

$(1)/out/result.hdf: $(1)/out/shell.ply $(1)/simulate.flags bin/tunica-simulate
	$$(call stage,$(1),simulate)
endef
$(foreach case,$(cases),$(eval $(call rules,$(case))))
