"""What each node offers: topics with their types and qualities of service, services, actions.

The table of the design, as other tests compare with it.
"""

NODES = ('program_loader', 'compensation_planner', 'axis_driver', 'run_recorder')

LATCHED, EVENTS = (True, True), (True, False)  # reliable, transient local

# Every topic: by whom, its type, its quality of service.
TOPICS = {
    'program': ('program_loader', 'cnc_msgs/msg/Program', LATCHED),
    'program/chunks': ('program_loader', 'cnc_msgs/msg/ProgramChunk', EVENTS),
    'programmed_contour': ('program_loader', 'cnc_msgs/msg/ProgrammedContour', LATCHED),
    'programmed_contour/chunks': ('program_loader', 'cnc_msgs/msg/ContourChunk', EVENTS),
    'tool_table': ('compensation_planner', 'cnc_msgs/msg/ToolTable', LATCHED),
    'compensated_path': ('compensation_planner', 'cnc_msgs/msg/CompensatedPath', LATCHED),
    'compensated_path/chunks': ('compensation_planner', 'cnc_msgs/msg/PathChunk', EVENTS),
    'compensated_path/preview': ('compensation_planner', 'nav_msgs/msg/Path', LATCHED),
    'markers': ('compensation_planner', 'visualization_msgs/msg/MarkerArray', LATCHED),
    'compensation_report': ('compensation_planner', 'cnc_msgs/msg/CompensationReport', LATCHED),
    'machine_state': ('axis_driver', 'cnc_msgs/msg/MachineState', LATCHED),
    'controller_settings': ('axis_driver', 'cnc_msgs/msg/ControllerSettings', LATCHED),
    'run_result': ('axis_driver', 'cnc_msgs/msg/RunResult', LATCHED),
    'controller_traffic': ('axis_driver', 'cnc_msgs/msg/ControllerTraffic', EVENTS),
    'joint_states': ('axis_driver', 'sensor_msgs/msg/JointState', EVENTS),
    'tool_pose': ('axis_driver', 'geometry_msgs/msg/PoseStamped', EVENTS),
    '/tf': ('axis_driver', 'tf2_msgs/msg/TFMessage', EVENTS),
    'recording': ('run_recorder', 'cnc_msgs/msg/Recording', LATCHED),
    **{f'{name}/_action/status': ('axis_driver', 'action_msgs/msg/GoalStatusArray', LATCHED)
       for name in ('run_program', 'home', 'jog', 'probe')},
    **{f'{name}/_action/feedback': (
        'axis_driver', f'cnc_msgs/action/{kind}_FeedbackMessage', EVENTS)
       for name, kind in [('run_program', 'RunProgram'), ('home', 'Home'), ('jog', 'Jog'),
                          ('probe', 'Probe')]},
}

# Of every node.
COMMON = {
    '/rosout': ('rcl_interfaces/msg/Log', LATCHED),
    '/diagnostics': ('diagnostic_msgs/msg/DiagnosticArray', EVENTS),
    '/parameter_events': ('rcl_interfaces/msg/ParameterEvent', EVENTS),
    'node_parameters': ('cnc_msgs/msg/NodeParameters', LATCHED),
    '~/transition_event': ('lifecycle_msgs/msg/TransitionEvent', EVENTS),
}

TRIGGERS = ('feed_hold', 'door_hold', 'resume', 'soft_reset', 'unlock', 'sleep', 'cancel',
            'confirm_tool_change')
SERVICES = {
    'program_loader': {
        'load_program': 'LoadProgram', 'continue_program': 'ContinueProgram',
        'put_program_chunk': 'PutProgramChunk',
        'program/get_chunks': 'GetProgramChunks',
        'programmed_contour/get_chunks': 'GetContourChunks', 'read_block': 'ReadBlock'},
    'compensation_planner': {
        'set_tool': 'SetTool', 'get_tools': 'GetTools', 'get_findings': 'GetFindings',
        'compensated_path/get_chunks': 'GetPathChunks', 'plan_block': 'PlanBlock',
        'plan_start': 'PlanStart'},
    'axis_driver': {
        'set_overrides': 'SetOverrides', 'set_work_offset': 'SetWorkOffset',
        'execute_mdi': 'ExecuteMdi', 'get_traffic': 'GetTraffic',
        'configure_controller': 'ConfigureController'},
    'run_recorder': {},
}
# Of every node, below its name.
COMMON_SERVICES = {
    **{f'{kind}_parameters': f'rcl_interfaces/srv/{kind.title()}Parameters'
       for kind in ('describe', 'get', 'list', 'set')},
    'get_parameter_types': 'rcl_interfaces/srv/GetParameterTypes',
    'set_parameters_atomically': 'rcl_interfaces/srv/SetParametersAtomically',
    'get_logger_levels': 'rcl_interfaces/srv/GetLoggerLevels',
    'set_logger_levels': 'rcl_interfaces/srv/SetLoggerLevels',
    'change_state': 'lifecycle_msgs/srv/ChangeState',
    'get_state': 'lifecycle_msgs/srv/GetState',
    'get_available_states': 'lifecycle_msgs/srv/GetAvailableStates',
    'get_available_transitions': 'lifecycle_msgs/srv/GetAvailableTransitions',
    'get_transition_graph': 'lifecycle_msgs/srv/GetAvailableTransitions',
    'get_type_description': 'type_description_interfaces/srv/GetTypeDescription',
}
ACTIONS = {'run_program': 'RunProgram', 'home': 'Home', 'jog': 'Jog', 'probe': 'Probe'}
