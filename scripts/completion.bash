# Tab completion for the tools, nodes and scripts of assembly_cell in bash, out of what their --help prints: commands and options,
# otherwise files. `source scripts/completion.bash` in the package's folder; the Debian package brings it along.

# _assembly_cell_words WORD PROGRAM [COMMAND]: what may stand for WORD
_assembly_cell_words() {
  local word=$1 help
  shift
  help=$(timeout 60 "$@" --help 2>/dev/null </dev/null) || return 0
  if [[ $word == -* ]]; then
    grep -oE '(^|[^[:alnum:]_-])--?[a-z][a-z0-9-]*' <<<"$help" | grep -oE -- '--?[a-z].*' | sort -u
  elif [ $# -eq 1 ]; then
    # commands: `  list   runs, the latest first`, `usage: calibrate plan NAME`
    sed -nE "s/^ {2,4}([a-z_]+)( {2,}.*)?\$/\\1/p; s/^(usage:|      ) *$(basename "$1") ([a-z_]+)( .*)?\$/\\2/p" <<<"$help" | sort -u
  fi
}

# _assembly_cell_reply PROGRAM WORD_BEFORE...: COMPREPLY for the word at the cursor
_assembly_cell_reply() {
  local word=${COMP_WORDS[COMP_CWORD]} words
  words=$(_assembly_cell_words "$word" "$1")
  # the options of a command are in its own help
  if [[ ${2:-} =~ ^[a-z_]+$ ]]; then words+=$'\n'$(_assembly_cell_words "$word" "$1" "$2"); fi
  if [ $# -gt 1 ] && [[ $word != -* ]]; then words=; fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word" | sort -u)
}

_assembly_cell() {
  _assembly_cell_reply "${1/#\~/$HOME}" "${COMP_WORDS[@]:1:COMP_CWORD-1}"
}

# `rosrun assembly_cell PROGRAM ...`; what comes before is completed by rosbash
_assembly_cell_rosrun() {
  local folder
  if [ "$COMP_CWORD" -ge 3 ] && [ "${COMP_WORDS[1]}" = assembly_cell ]; then
    while IFS= read -r -d : folder; do
      if [ -x "$folder/lib/assembly_cell/${COMP_WORDS[2]}" ]; then
        _assembly_cell_reply "$folder/lib/assembly_cell/${COMP_WORDS[2]}" "${COMP_WORDS[@]:3:COMP_CWORD-3}"
        return
      fi
    done <<<"${CMAKE_PREFIX_PATH:-}:/usr:"
  fi
  if ! declare -F _roscomplete_exe >/dev/null && [ -r /usr/share/bash-completion/completions/rosbash ]; then
    . /usr/share/bash-completion/completions/rosbash
    complete -o default -F _assembly_cell_rosrun rosrun
  fi
  if declare -F _roscomplete_exe >/dev/null; then _roscomplete_exe "$@"; fi
}

_assembly_cell_register() {
  local folder name
  folder=$(realpath "$(dirname "${BASH_SOURCE[0]}")/..")
  complete -o default -F _assembly_cell_rosrun rosrun
  if [ -e "$folder/scripts/common.sh" ]; then  # the source tree
    for name in build run test calibrated_cell faults launch make_peg plot results/make; do
      complete -o default -F _assembly_cell "scripts/$name" "./scripts/$name" "$folder/scripts/$name"
    done
    for name in "$folder"/.build/devel/lib/assembly_cell/*; do
      complete -o default -F _assembly_cell "$name" ".build${name#*/.build}"
    done
  else
    for name in /usr/lib/assembly_cell/*; do complete -o default -F _assembly_cell "$name"; done
  fi
}
_assembly_cell_register
unset -f _assembly_cell_register
