# Tab completion of the commands of smach_oracle, with the words of 60.completion_words.

# behind COMMAND: its options, what one of them takes, or files
_smach_oracle_behind() {
  local key=$1 current=${COMP_WORDS[COMP_CWORD]} words
  words=$(_smach_oracle_words "$key ${COMP_WORDS[COMP_CWORD - 1]}")
  [[ -n $words ]] || words=$(_smach_oracle_words "$key")
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}

_smach_oracle_direct() {
  local word key=${1##*/}
  for word in "${COMP_WORDS[@]:1:COMP_CWORD - 1}"; do
    [[ -z $(_smach_oracle_words "$key $word") || $word == -* ]] || key="$key $word"
  done
  _smach_oracle_behind "$key"
}

_smach_oracle_rosrun() {
  local current=${COMP_WORDS[COMP_CWORD]} word key=${COMP_WORDS[2]-}
  if [[ ${COMP_WORDS[1]-} == smach_oracle ]] && ((COMP_CWORD > 2)); then
    for word in "${COMP_WORDS[@]:3:COMP_CWORD - 3}"; do
      [[ -z $(_smach_oracle_words "$key $word") || $word == -* ]] || key="$key $word"
    done
    _smach_oracle_behind "$key"
  elif declare -F "$_smach_oracle_others" >/dev/null; then
    "$_smach_oracle_others" "$@"
  elif ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W smach_oracle -- "$current")
  elif [[ ${COMP_WORDS[1]-} == smach_oracle ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$_smach_oracle_commands" -- "$current")
  fi
}

# rosbash's, where it has been sourced before
_smach_oracle_before=$(complete -p rosrun 2>/dev/null | sed -n 's/.* -F \([^ ]*\).*/\1/p')
[[ $_smach_oracle_before == _smach_oracle_rosrun ]] ||
  _smach_oracle_others=${_smach_oracle_before:-_smach_oracle_nobody}
unset _smach_oracle_before
complete -o default -F _smach_oracle_rosrun rosrun
# shellcheck disable=SC2086  # a list of words
complete -o default -F _smach_oracle_direct $_smach_oracle_commands
