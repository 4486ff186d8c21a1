# The words of 61.completion. Written by write_completion.py.
_smach_oracle_commands='bag_statistics compare expert_console expert_query_server expert_terminal
inspection_inspector inspection_navigator inspection_world joy_teleoperation
learn manipulation_interface oracle_disk oracle_run oracle_state
perception_interface pr2_film pr2_manipulation pr2_perception pr2_world
run_trials scripted_expert scripted_operator'

_smach_oracle_words() {
  case $1 in
    'bag_statistics')
      echo '--by --by-state --columns --csv --failing-outcomes --figure --help --html --json
--scheduler --version --without-tls --x-axis -h' ;;
    'bag_statistics --by')
      echo 'folder node host version settings script day' ;;
    'bag_statistics --columns')
      echo '1 2' ;;
    'bag_statistics --x-axis')
      echo 'trials time' ;;
    'compare')
      echo '--help --version -h figures oracles same_trials variants what_if' ;;
    'compare figures')
      echo '--help --output -h' ;;
    'compare oracles')
      echo '--failing-outcomes --figure --help --wide -h' ;;
    'compare same_trials')
      echo '--help -h' ;;
    'compare variants')
      echo '--by --help -h' ;;
    'compare variants --by')
      echo 'file folder node host version settings script day' ;;
    'compare what_if')
      echo '--estimator --help --high-from --json --memory --moderate-from --policy --prior
--wide -h' ;;
    'compare what_if --estimator')
      echo 'exponential window' ;;
    'compare what_if --policy')
      echo 'algorithm1 always_ask any_way escalating ladder learned prose random restart
retry step_back' ;;
    'expert_console')
      echo '--bags --help --port --stores --try-calls --version -h' ;;
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
    'learn')
      echo '--explain --help --rates-file --version -h' ;;
    'manipulation_interface')
      echo '--help --version -h' ;;
    'oracle_disk')
      echo '--delete --help --keep-days --keep-gb --version -h' ;;
    'oracle_run')
      echo '--check --checkpoint --config --from --help --machine-name --no-nested --policy
--rates-file --record --record-topic --repeat --resume --resume-map --version
--without-oracle -h' ;;
    'oracle_run --policy')
      echo 'algorithm1 always_ask any_way escalating ladder learned prose random restart
retry step_back' ;;
    'oracle_state')
      echo '--help --version -h accept drop edit goto list log moments show' ;;
    'oracle_state accept')
      echo '--help -h' ;;
    'oracle_state drop')
      echo '--help --trial -h' ;;
    'oracle_state edit')
      echo '--container --help --trial -h' ;;
    'oracle_state goto')
      echo '--help --repeat --trial -h' ;;
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
      echo '--answer-delay --benign --estimator --extra-causes --frozen --help --high-from
--hours --hung-after --jobs --lasting --max-recoveries --memory --moderate-from
--output --plan --policy --prior --protocol --replicates --scheduler --seed
--task --trials --variants --version --without-tls -h' ;;
    'run_trials --estimator')
      echo 'exponential window' ;;
    'run_trials --policy')
      echo 'configured algorithm1 always_ask any_way escalating ladder learned prose random
restart retry step_back' ;;
    'run_trials --protocol')
      echo 'main persistence memory continuous fifth fifth_extension all' ;;
    'run_trials --task')
      echo 'drink_retrieval inspection pick_and_place' ;;
    'run_trials --variants')
      echo 'both with without bare default algorithm1 always_ask any_way escalating ladder
learned prose random restart retry step_back one_line:algorithm1
one_line:always_ask one_line:any_way one_line:escalating one_line:ladder
one_line:learned one_line:prose one_line:random one_line:restart one_line:retry
one_line:step_back' ;;
    'scripted_expert')
      echo '--help --version -h' ;;
    'scripted_operator')
      echo '--help --version -h' ;;
  esac
}
