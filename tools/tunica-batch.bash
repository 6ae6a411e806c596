# bash completion of tunica-batch: variables, their values, files.
_tunica_batch() {
  local current=${COMP_WORDS[COMP_CWORD]} name='' before=''
  # Most shells break a word at '=', some do not.
  if [[ $current == '=' ]]; then
    name=${COMP_WORDS[COMP_CWORD - 1]} current=''
  elif ((COMP_CWORD > 1)) && [[ ${COMP_WORDS[COMP_CWORD - 1]} == '=' ]]; then
    name=${COMP_WORDS[COMP_CWORD - 2]}
  elif [[ $current == *=* ]]; then
    name=${current%%=*} before=$name= current=${current#*=}
  fi
  local words='' kind=-W
  case $name in
    '')
      words='CASES= VOLUMES= LABELS= LABEL= NAMES= ISOVALUE= SMOOTH= LARGEST= FILL= OPEN= CUT= SHELLS= TOLERANCE= ACCURACY= OF= METHOD=
        PRESSURE= YOUNG= POISSON= THICKNESS= IMAGED_AT= MID_SURFACE= KIND= LOAD_STEPS= DENSITY= DURATION= STEP= FIX= SUPPORT= OUT= THREADS=
        MEM= RUN= EXTRACT= DECIMATE= RELAX= SIMULATE= -j -k -n -h --help --version help' ;;
    SMOOTH) words='none staircase' ;;
    LARGEST | FILL | OPEN) words='0 1' ;;
    OF) words='membrane tension stress displacement energy volume' ;;
    METHOD) words='fit barycentre' ;;
    MID_SURFACE) words='inner outer' ;;
    KIND) words='static dynamic' ;;
    FIX) words='boundary rims:slide rigid-motions' ;;
    CASES | VOLUMES | NAMES) kind=-f ;;
    OUT) kind=-d ;;
  esac
  if [[ $kind == -W ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -P "$before" -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen "$kind" -P "$before" -- "$current")
    compopt -o filenames 2> /dev/null
  fi
  if [[ ${COMPREPLY[0]} == *= ]]; then
    compopt -o nospace 2> /dev/null
  fi
}
complete -F _tunica_batch tunica-batch
