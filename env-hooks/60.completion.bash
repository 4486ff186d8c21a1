# Tab completion of the commands of smach_oracle. Written by write_completion.py.
_smach_oracle_commands='bag_statistics compare_oracles compare_variants draw_results expert_console
expert_query_server expert_terminal inspection_inspector inspection_navigator
inspection_world joy_teleoperation manipulation_interface oracle_disk oracle_run
oracle_state perception_interface pr2_film pr2_manipulation pr2_perception
pr2_world run_trials same_trials scripted_expert scripted_operator what_if'

_smach_oracle_words() {
  case $1 in
    'bag_statistics')
      echo '--columns --csv --failing-outcomes --figure --help --json --version --x-axis -h' ;;
    'bag_statistics --columns')
      echo '1 2' ;;
    'bag_statistics --x-axis')
      echo 'trials time' ;;
    'compare_oracles')
      echo '--figure --help --version -h' ;;
    'compare_variants')
      echo '--help --version -h' ;;
    'draw_results')
      echo '--help --version -h' ;;
    'expert_console')
      echo '--help --version -h' ;;
    'expert_query_server')
      echo '--help --version -h' ;;
    'expert_terminal')
      echo '--help --name --server --version -h' ;;
    'inspection_inspector')
      echo '--help --version -h' ;;
    'inspection_navigator')
      echo '--help --version -h' ;;
    'inspection_world')
      echo '--help --version -h' ;;
    'joy_teleoperation')
      echo '--help --version -h' ;;
    'manipulation_interface')
      echo '--help --version -h' ;;
    'oracle_disk')
      echo '--delete --help --keep-days --keep-gb --version -h' ;;
    'oracle_run')
      echo '--check --checkpoint --config --from --help --name --no-nested --policy
--rates-file --record --record-topic --resume --resume-map --version
--without-oracle -h' ;;
    'oracle_run --policy')
      echo 'algorithm1 always_ask ladder prose random restart retry step_back' ;;
    'oracle_state')
      echo '--help --version -h drop edit goto list log moments show' ;;
    'oracle_state drop')
      echo '--help --trial -h' ;;
    'oracle_state edit')
      echo '--container --help --trial -h' ;;
    'oracle_state goto')
      echo '--help --trial -h' ;;
    'oracle_state list')
      echo '--help -h' ;;
    'oracle_state log')
      echo '--help --trial -h' ;;
    'oracle_state moments')
      echo '--help --trial -h' ;;
    'oracle_state show')
      echo '--at --help --trial -h' ;;
    'perception_interface')
      echo '--help --version -h' ;;
    'pr2_film')
      echo '--fps --help --seed --task --version --video -h' ;;
    'pr2_film --task')
      echo 'drink_retrieval pick_and_place' ;;
    'pr2_manipulation')
      echo '--help --version -h' ;;
    'pr2_perception')
      echo '--help --version -h' ;;
    'pr2_world')
      echo '--help --version -h' ;;
    'run_trials')
      echo '--abandon-freeze --answer-delay --arms --benign --estimator --freeze --frozen
--help --high-from --hours --hung-after --jobs --lasting --max-recoveries
--memory --moderate-from --output --plan --policy --prior --protocol
--replicates --seed --task --trials --variants --version -h' ;;
    'run_trials --arms')
      echo 'both with without' ;;
    'run_trials --estimator')
      echo 'exponential window' ;;
    'run_trials --policy')
      echo 'configured algorithm1 always_ask ladder prose random restart retry step_back' ;;
    'run_trials --protocol')
      echo 'main persistence memory continuous all' ;;
    'run_trials --task')
      echo 'drink_retrieval pick_and_place' ;;
    'run_trials --variants')
      echo 'both with without bare default algorithm1 always_ask ladder prose random restart
retry step_back' ;;
    'same_trials')
      echo '--help --version -h' ;;
    'scripted_expert')
      echo '--help --version -h' ;;
    'scripted_operator')
      echo '--help --version -h' ;;
    'what_if')
      echo '--help --high-from --json --memory --moderate-from --policy --prior --version -h' ;;
    'what_if --policy')
      echo 'algorithm1 always_ask ladder prose random restart retry step_back' ;;
  esac
}

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
