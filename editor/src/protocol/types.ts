/**
 * The protocol's data, requests and events. Generated from arcor2_hw.data by editor/protocol_types.py: do not edit.
 *
 * A field with `?` may be omitted. Lengths are in m, angles in rad, quaternions x, y, z, w.
 */

/** Arguments of AcknowledgeAlarm: number of the record, and a note. */
export interface AcknowledgeAlarmArgs {
  number: number;
  note?: string;
}

/** The least role that may acknowledge an alarm. */
export type AcknowledgeRole = "operator" | "technician";

/** Arguments of AcknowledgeStop: the stop or fault of a robot; with `code`, an alarm of any device. */
export interface AcknowledgeStopArgs {
  object_id: string;
  code?: string;
}

/**
 * An action on an action point, or of a function.
 *
 * `error_output` names the error for the actions after an error exit; without it, the error is not stored. `retry`
 * repeats an action that is safe to repeat. `branches` are the ids of the calls that an action of type
 * `functions/parallel` runs at once; no connection leads to or from them.
 */
export interface Action {
  name: string;
  type: string;
  id: string;
  parameters: ActionParameter[];
  flows: Flow[];
  error_output?: string;
  retry?: Retry;
  branches?: string[];
}

/** The source of the duration of an action. count: number of executions of which it is the median. */
export interface ActionDuration {
  action_id: string;
  source: DurationSource;
  count: number;
}

/** Data of the event ActionExecution. */
export interface ActionExecutionData {
  action_id: string;
}

/**
 * Duration of a hold at an action, and the author of the decision.
 *
 * duration: s; omitted while the program is held. choice, by: the decision, and the name of a user or token; omitted
 * while the program is held, and if it was stopped.
 */
export interface ActionHold {
  since: string;
  duration?: number;
  choice?: HoldChoice;
  by?: string;
}

/**
 * Properties of an action. `composite` actions may call others; `hidden` actions are not offered to users.
 *
 * verdict (not in ARCOR2): whether the returned boolean says that a part is good. again (not in ARCOR2): whether the
 * action may be repeated after it has failed; ask if it is omitted.
 */
export interface ActionMetadata {
  composite: boolean;
  hidden: boolean;
  cancellable: boolean;
  verdict?: boolean;
  again?: Again;
}

/** An action of a run; `name` is empty when the project does not contain it. */
export interface ActionOfRun {
  id: string;
  name: string;
}

/** Arguments of ActionParamValues. */
export interface ActionParamValuesArgs {
  id: string;
  param_id: string;
  parent_params?: IdValue[];
}

/** A literal, a project parameter, a parameter of the function, or a link to a result, depending on `type`. */
export interface ActionParameter {
  name: string;
  type: string;
  value: string;
}

/** An action point with orientations, joints and actions. */
export interface ActionPoint {
  name: string;
  position: Position;
  parent?: string;
  display_name?: string;
  description?: string;
  id: string;
  orientations: NamedOrientation[];
  robot_joints: ProjectRobotJoints[];
  actions: Action[];
}

/** Data of the event ActionResult. */
export interface ActionResultData {
  action_id: string;
  results?: string[];
  error?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event ActionStateAfter. */
export interface ActionStateAfterData {
  action_id: string;
  results?: string[];
}

/** Data of the event ActionStateBefore. */
export interface ActionStateBeforeData {
  action_id?: string;
  parameters?: string[];
  action_point_ids?: string[];
  thread_id?: number;
}

/** An action in a run. median: of its durations, s. total: sum of its durations, s. */
export interface ActionTimes {
  action_id: string;
  name: string;
  device: string;
  count: number;
  median: number;
  total: number;
}

/** Arguments of AddAction; `error_output` names its error, `retry` repeats it after it has failed. */
export interface AddActionArgs {
  action_point_id: string;
  name: string;
  type: string;
  parameters?: ActionParameter[];
  flows?: Flow[];
  error_output?: string;
  retry?: Retry;
}

/** Arguments of AddActionPoint. */
export interface AddActionPointArgs {
  name: string;
  position: Position;
  parent?: string;
}

/** Arguments of AddActionPointJointsUsingRobot. */
export interface AddActionPointJointsUsingRobotArgs {
  action_point_id: string;
  robot_id: string;
  name?: string;
  arm_id?: string;
  end_effector_id?: string;
}

/** Arguments of AddActionPointOrientation. */
export interface AddActionPointOrientationArgs {
  action_point_id: string;
  orientation: Orientation;
  name?: string;
}

/** Arguments of AddActionPointOrientationUsingRobot. */
export interface AddActionPointOrientationUsingRobotArgs {
  action_point_id: string;
  robot: RobotArg;
  name?: string;
}

/** Arguments of AddApUsingRobot. */
export interface AddApUsingRobotArgs {
  robot_id: string;
  end_effector_id: string;
  name: string;
  arm_id?: string;
}

/** Arguments of AddFunction. */
export interface AddFunctionArgs {
  name: string;
}

/** Answer to AddFunction. */
export interface AddFunctionData {
  id: string;
}

/** Arguments of AddFunctionParameter; `value` is the parameter for the present calls of the function. */
export interface AddFunctionParameterArgs {
  function_id: string;
  name: string;
  type: string;
  value?: Parameter;
}

/** Arguments of AddFunctionResult; `link` is `<action id>/default/<output index>`. */
export interface AddFunctionResultArgs {
  function_id: string;
  link: string;
}

/** Arguments of AddLogicItem; `error_kinds` make the item an error exit, `when` is a condition of comparisons. */
export interface AddLogicItemArgs {
  start: string;
  end: string;
  condition?: ProjectLogicIf;
  error_kinds?: string[];
  when?: LogicWhen;
}

/**
 * Arguments of AddObjectToScene.
 *
 * node (not in ARCOR2): name of the node on which the object runs; empty or omitted for the computer of the server.
 */
export interface AddObjectToSceneArgs {
  name: string;
  type: string;
  pose?: Pose;
  parameters?: Parameter[];
  node?: string;
}

/** Arguments of AddOverride. */
export interface AddOverrideArgs {
  id: string;
  override: Parameter;
}

/** Arguments of AddPerson: name, role, and PIN, card or both. */
export interface AddPersonArgs {
  name: string;
  role: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  pin?: string;
  card?: string;
}

/** Arguments of AddProjectParameter; actions can change a `variable`. */
export interface AddProjectParameterArgs {
  name: string;
  type: string;
  value: string;
  variable?: boolean;
}

/** Arguments of AddVirtualCollisionObjectToScene. */
export interface AddVirtualCollisionObjectToSceneArgs {
  name: string;
  pose: Pose;
  model: ObjectModel;
}

/** Whether an action may be repeated after a failure: always, after confirmation by a person, or never. */
export type Again = "safe" | "ask" | "never";

/**
 * A condition that needs attention; `remedy` says what to do.
 *
 * text_message, remedy_message: the text and the remedy with the data for their translation, if they have values.
 */
export interface Alarm {
  code: string;
  severity: Severity;
  text: string;
  remedy: string;
  since: string;
  text_message?: Message;
  remedy_message?: Message;
}

/** What an alarm is about. */
export type AlarmCategory = "connection" | "control" | "safety" | "device" | "supply" | "process" | "program" | "system";

/** Selection of alarms: those that need attention, the shelved ones, or the whole history. */
export type AlarmFilter = "retained" | "shelved" | "all";

/** Number and duration in s of the activations of an alarm of an object in a period. */
export interface AlarmFrequency {
  kind: string;
  code: string;
  text: string;
  count: number;
  duration: number;
  text_message?: Message;
  object_id?: string;
  object_name?: string;
}

/**
 * One occurrence of an alarm.
 *
 * number: number of the record. kind: group and number of its declaration, such as `conveyor-3`. object_id,
 * object_name: omitted for alarms of the program and the system. remedy_message, text_message: for translation, if the
 * text or the remedy has values. active: whether its condition persists. cleared: when the condition ended. retain:
 * whether it still needs attention: it is active, or it latches and is not acknowledged. first_up: number of the
 * record that came first of those with the same cause; its own number for the first one. count: number of
 * occurrences of the condition while the record was open. run: number of the run. action: name of the action that
 * failed.
 */
export interface AlarmRecord {
  number: number;
  kind: string;
  code: string;
  priority: Priority;
  category: AlarmCategory;
  text: string;
  raised: string;
  first_up: number;
  cause: string;
  remedy: string;
  text_message?: Message;
  remedy_message?: Message;
  object_id?: string;
  object_name?: string;
  object_type?: string;
  latching: boolean;
  acknowledge: AcknowledgeRole;
  can_be_shelved: boolean;
  active: boolean;
  acknowledged: boolean;
  retain: boolean;
  count: number;
  cleared?: string;
  acknowledged_at?: string;
  acknowledged_by?: string;
  note?: string;
  shelved_until?: string;
  shelved_by?: string;
  run?: number;
  action?: string;
  picture?: string;
}

/** Arguments of AlarmStatistics: number of past days, and maximum number of alarms in each list. */
export interface AlarmStatisticsArgs {
  days?: number;
  limit?: number;
}

/** Answer to AlarmStatistics: start of the period, the most frequent alarms, and those that were active longest. */
export interface AlarmStatisticsData {
  since: string;
  by_count: AlarmFrequency[];
  by_duration: AlarmFrequency[];
}

/** An alarm with the translations of its texts by its cell. */
export interface AlarmSummary {
  record: AlarmRecord;
  translations: Record<string, Record<string, string>>;
}

/** An assumption of a dry run, as a sentence. action_id: the action to which it applies. */
export interface Assumption {
  text: string;
  action_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Arguments of Authenticate. */
export interface AuthenticateArgs {
  token: string;
}

/** Answer to Authenticate: the name of the token and its role; `shared`: true if persons have to log on. */
export interface AuthenticateData {
  name: string;
  role: string;
  shared?: boolean;
}

/** Arguments of requests about a backup: the device and the backup. */
export interface BackupArgs {
  object_id: string;
  backup_id: string;
}

/**
 * A backup of the parameters of a device, without the parameters.
 *
 * identity: of the device that was read. at, by: time, and the user who requested it. count: number of parameters.
 *     digest: SHA-256 of identity, type and parameters. uploaded: whether it was uploaded as a file.
 */
export interface BackupInfo {
  id: string;
  object_id: string;
  object_type: string;
  identity: Identity;
  at: string;
  by: string;
  count: number;
  digest: string;
  uploaded: boolean;
}

/** An action without parameters and flows; `type` is `<object id>/<action name>`, or `<function id>/call`. */
export interface BareAction {
  name: string;
  type: string;
  id: string;
}

/** An action point without its lists; the position is relative to the parent, or global without one. */
export interface BareActionPoint {
  name: string;
  position: Position;
  parent?: string;
  display_name?: string;
  description?: string;
  id: string;
}

/** A project without its content. */
export interface BareProject {
  name: string;
  scene_id: string;
  description: string;
  has_logic: boolean;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
}

/** A scene without its objects. */
export interface BareScene {
  name: string;
  description: string;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
}

/** A box around its origin, edges in m. */
export interface Box {
  id: string;
  size_x: number;
  size_y: number;
  size_z: number;
}

/** The call stack of a branch, from the program itself to the innermost function. */
export interface Branch {
  id: string;
  frames: Frame[];
}

/** Arguments of BuildProject. */
export interface BuildProjectArgs {
  project_id: string;
  package_name: string;
}

/** Answer to BuildProject. */
export interface BuildProjectData {
  package_id: string;
}

/** Arguments of CalibrateCamera. */
export interface CalibrateCameraArgs {
  id: string;
}

/** Arguments of CalibrateRobot. */
export interface CalibrateRobotArgs {
  robot_id: string;
  camera_id?: string;
  move_to_calibration_pose?: boolean;
}

/**
 * A later measurement compared with a record: distance (m), angle (rad), and whether both are within limits.
 *
 * key and values translate the verdict.
 */
export interface CalibrationCheck {
  record_id: string;
  date: string;
  distance: number;
  angle: number;
  distance_limit: number;
  angle_limit: number;
  passed: boolean;
  verdict: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** An input of a calibration: SHA-256 in hex, size in bytes, and the path of the file if it is stored. */
export interface CalibrationInput {
  name: string;
  sha256: string;
  size: number;
  file?: string;
}

/** What was calibrated, and how. */
export type CalibrationKind = "camera_pose" | "robot_pose" | "hand_eye" | "intrinsics" | "base_frame" | "user_frame" | "tool_tip" | "tool_orientation" | "by_hand";

/**
 * One calibration.
 *
 * person: name of the user who did it. object_id and object_name: the scene object that was calibrated; parent:
 * name of the frame of the poses ("world", a robot's base or flange). inputs: images and tables for the computation;
 * parameters: other inputs (joints, markers, options), as JSON values. residual: in residual_unit ("m", "rad" or
 * "px"); result: the complete result, as JSON values. before and after: pose of the object before and after, where the
 * result is a pose; applied: whether the object's pose was set. key and values translate the verdict.
 */
export interface CalibrationRecord {
  kind: CalibrationKind;
  person: string;
  object_id: string;
  object_name: string;
  parent: string;
  verdict: string;
  residual?: number;
  residual_unit: string;
  inputs: CalibrationInput[];
  parameters: Record<string, unknown>;
  result: Record<string, unknown>;
  before?: Pose;
  after?: Pose;
  applied: boolean;
  id: string;
  date: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Arguments of CameraColorImage. */
export interface CameraColorImageArgs {
  id: string;
}

/** Arguments of CameraColorParameters. */
export interface CameraColorParametersArgs {
  id: string;
}

/**
 * Pinhole intrinsics in pixels with 4, 5, 8 or 12 distortion coefficients in OpenCV's order.
 *
 * Raises ValueError for another number of coefficients.
 */
export interface CameraParameters {
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  dist_coefs: number[];
}

/**
 * A part that a robot carries.
 *
 * link: end effector, or link of the robot. pose: in its frame. model: omitted for a collision object of the scene,
 * which has the same name.
 */
export interface CarriedPart {
  name: string;
  link: string;
  pose: Pose;
  model?: ObjectModel;
}

/** Who may start programs: clients of the server, the PLC, or nobody. */
export type CellAuthority = "nobody" | "hub" | "plc";

/** The cell of the server. fleet: address of the page with all cells; left out if there is none. */
export interface CellInfo {
  name: string;
  fleet?: string;
}

/** A job: the number by which the PLC requests it, and the package that it runs. */
export interface CellJob {
  number: number;
  package_id: string;
}

/** The modes of the cell; arcor2_hw.data.packml.UnitMode has their numbers. */
export type CellMode = "produce" | "maintenance" | "manual" | "changeover";

/** The states of PackML that the cell has; arcor2_hw.data.packml.MachineState has their numbers. */
export type CellStateName = "stopped" | "starting" | "idle" | "execute" | "stopping" | "aborting" | "aborted" | "holding" | "held" | "unholding" | "complete";

/**
 * The cell.
 *
 * jobs: by number. job: number of the job that the PLC has started and that has not ended. held_by_plc: whether the
 * PLC has commanded the hold. plc: left out if the server has no Modbus block. opcua: whether plant systems can
 * command the cell over OPC UA; left out if not.
 */
export interface CellStatus {
  state: CellStateName;
  mode: CellMode;
  authority: CellAuthority;
  jobs: CellJob[];
  held_by_plc: boolean;
  job?: number;
  plc?: PlcLink;
  opcua?: boolean;
}

/** Arguments of ChangeOwnPin: the present PIN of the person who is logged on, and the new one. */
export interface ChangeOwnPinArgs {
  pin: string;
  new_pin: string;
}

/** Arguments of ChangePerson: the changes. An empty `pin` or `card` is removed; `unlock` ends all lock-outs. */
export interface ChangePersonArgs {
  id: string;
  name?: string;
  role?: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  pin?: string;
  card?: string;
  unlock?: boolean;
}

/** Kind of change of the item in an event. */
export type ChangeType = "add" | "update" | "remove" | "update_base";

/** A file that differs between two packages. */
export interface ChangedFile {
  path: string;
  change: FileChange;
}

/** A value that differs between two recipes, JSON in a string; omitted where it is missing. */
export interface ChangedValue {
  name: string;
  before?: string;
  after?: string;
}

/**
 * The production of the cell: the recipe, and the previous one, to which it can be rolled back.
 *
 * released_only: whether operators may run only released recipes. by, at: the user and the time of the changeover.
 */
export interface Changeover {
  released_only: boolean;
  recipe_id?: string;
  previous_id?: string;
  by: string;
  at?: string;
}

/**
 * Arguments of CheckCalibration: a record, a pose in its frame, and the limits of the difference (m, rad).
 *
 * pose: a measured pose or a reference; default: the pose of the object in the open scene.
 */
export interface CheckCalibrationArgs {
  id: string;
  pose?: Pose;
  distance_limit?: number;
  angle_limit?: number;
}

/**
 * Arguments of CheckConnection: type and settings of a device, and its id if it is an object of the scene.
 *
 * The id gives access to the stored secrets of the object, which is checked on its node. Other devices are checked on
 * `node`; empty for the computer of the server.
 */
export interface CheckConnectionArgs {
  type: string;
  parameters?: Parameter[];
  id?: string;
  node?: string;
}

/** Answer to CheckConnection: the data reported by the connected device, and the time to connect, s. */
export interface CheckConnectionData {
  identity: Identity;
  health: Health;
  alarms: Alarm[];
  seconds: number;
}

/** Answer to CheckScript: the first problem, or the items that the import would change. */
export interface CheckScriptData {
  revision: number;
  problems: ScriptProblem[];
  changes: HistoryItem[];
}

/** Arguments of CloseProject. */
export interface CloseProjectArgs {
  force?: boolean;
}

/** Arguments of CloseScene. */
export interface CloseSceneArgs {
  force?: boolean;
}

/** The collision models of a package's scene, by kind. */
export interface CollisionModels {
  boxes: Box[];
  spheres: Sphere[];
  cylinders: Cylinder[];
  meshes: Mesh[];
}

/** Answer to CompareParameters: the differences by name, and the number of equal parameters. */
export interface CompareParametersData {
  differences: ParameterDifference[];
  equal: number;
}

/** Arguments of CompareRecipes: ids of two recipes. */
export interface CompareRecipesArgs {
  before: string;
  after: string;
}

/** Arguments of ConfirmDevice: the device, and the new identity that was shown to the technician. */
export interface ConfirmDeviceArgs {
  object_id: string;
  identity: Identity;
}

/**
 * Arguments of ConfirmParts: places where a person has found parts. No parts: only confirms the interruption.
 *
 * dismiss: the interrupted program does not continue; it starts from its beginning.
 */
export interface ConfirmPartsArgs {
  scene_id: string;
  parts: ConfirmedPart[];
  dismiss?: boolean;
}

/**
 * The place of a part as a person has found it.
 *
 * number: of the part; 0: a part that is not in the inventory, which counts as fed. place: id of the place; empty: the
 * part was taken out of the cell, which counts as rejected. serial: corrects the serial number. exists: false if there
 * has never been such a part, for example because a sensor was wrong: it does not count as fed. A part that was read
 * has existed.
 */
export interface ConfirmedPart {
  number: number;
  place: string;
  serial?: string;
  exists?: boolean;
}

/** State of a connection. */
export type Connection = "offline" | "connecting" | "online" | "lost" | "back" | "failed";

/** Arguments of CopyActionPoint. */
export interface CopyActionPointArgs {
  id: string;
  position?: Position;
}

/** Arguments of CopyProject. */
export interface CopyProjectArgs {
  source_id: string;
  target_name: string;
}

/** Arguments of CopyScene. */
export interface CopySceneArgs {
  source_id: string;
  target_name: string;
}

/** A point in the image, px. */
export interface Corner {
  x: number;
  y: number;
}

/** The value of a counter of the program; `id` and `name` are those of its object. */
export interface CounterValue {
  id: string;
  name: string;
  value: number;
}

/** Arguments of CreateAdministrator: name and PIN of the first person. */
export interface CreateAdministratorArgs {
  name: string;
  pin: string;
}

/** A cylinder around its origin along z, m. */
export interface Cylinder {
  id: string;
  radius: number;
  height: number;
}

/**
 * Arguments of DecideHeld.
 *
 * number: of the action at which the program is held. results: for `result`, the results of the action, each as JSON
 * in a text. exit_id: for `error_exit`, the id of the logic item; default: the first exit. confirmed: for `retry` of
 * an action that is not safe to repeat, whether a person has confirmed it.
 */
export interface DecideHeldArgs {
  number: number;
  choice: HoldChoice;
  results?: string[];
  exit_id?: string;
  confirmed?: boolean;
}

/** Answer to DeleteObjectTypes. */
export interface DeleteObjectTypesData {
  id: string;
  error: string;
}

/** Arguments of DeleteOverride. */
export interface DeleteOverrideArgs {
  id: string;
  override: Parameter;
}

/** Arguments of requests about a device: id of the scene object. */
export interface DeviceArgs {
  object_id: string;
}

/**
 * Identity and state of a device of the workplace.
 *
 * Attributes:
 *     object_id: Id of the scene object.
 *     name: Its name.
 *     object_type: Its object type.
 *     identity: The confirmed identity; the first one needs no confirmation.
 *     found: The identity of the connected device, if it is not the confirmed one. Then it is not commanded.
 *     differing: The fields of `found` that differ.
 *     first_seen: Time of the first connection of the device.
 *     seen: Time at which its identity was last read.
 *     confirmed_at: Time at which a technician confirmed the identity; omitted if it was seen first.
 *     confirmed_by: The technician who confirmed it.
 *     parameters: Whether the driver can read the parameters.
 *     restores: Whether it can write them.
 *     hours: Hours for which the device was connected since `counted_since`.
 *     cycles: Number of actions that it executed since then.
 *     counters: Counters of the device itself by name, read together with its identity.
 *     counted_since: Time at which this device, by its serial number, was put into operation here.
 *     problem: Reason why the identity could not be read at the last connection; `key` and `values` translate it.
 *     backups: The backups of its parameters, newest first.
 */
export interface DeviceCard {
  object_id: string;
  name: string;
  object_type: string;
  identity: Identity;
  first_seen: string;
  seen: string;
  counted_since: string;
  found?: Identity;
  differing: string[];
  confirmed_at?: string;
  confirmed_by?: string;
  parameters: boolean;
  restores: boolean;
  hours: number;
  cycles: number;
  counters: Record<string, number>;
  problem?: string;
  backups: BackupInfo[];
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * A parameter that a device stores.
 *
 * name: unique in the device, as in its manual, such as "servo 1: homing offset". unit: of the value as the device
 * stores it; empty for a plain number.
 */
export interface DeviceParameter {
  name: string;
  value: boolean | number | string;
  unit: string;
}

/** A device in a run. busy: time during which it executed actions, s. share: `busy` divided by the whole time. */
export interface DeviceTimes {
  id: string;
  name: string;
  busy: number;
  share: number;
}

/**
 * A time in which a device waits between two of its actions while another device executes actions.
 *
 * for_device: id of the device that is busy for most of it. before: name of the action after it.
 */
export interface DeviceWait {
  device: string;
  for_device: string;
  before: string;
  start: number;
  duration: number;
}

/** Arguments of DissolveCall: an action that calls a function, and whether to remove the function. */
export interface DissolveCallArgs {
  action_id: string;
  remove_function?: boolean;
}

/** Answer to DissolveCall: the actions that replace the call. */
export interface DissolveCallData {
  action_ids: string[];
}

/** Arguments of DissolveParallel: a parallel action, whose calls then run one after the other. */
export interface DissolveParallelArgs {
  action_id: string;
}

/**
 * An action of the present cycle that has ended. Clients do not receive it.
 *
 * branch: of the program. action_id, name, device: the action and its object. results: in JSON. stored: whether the
 * results are stored. error, code, text: kind, code and message of an error that the program has handled. lasts:
 * whether its effect ends with the program. moved: whether it has moved a part; source, target: its places before and
 * after.
 */
export interface DoneAction {
  branch: string;
  action_id: string;
  name: string;
  device: string;
  results?: string[];
  stored?: boolean;
  error?: string;
  code?: string;
  text?: string;
  lasts?: boolean;
  moved?: boolean;
  source?: string;
  target?: string;
}

/**
 * A dry run without its result, and data of the event DryRunChanged.
 *
 * number: grows by one with each dry run since the start of the server. revision: revision of the project (see
 * History) that was checked. from_action: the first action, omitted for START. error: reason of a failure, with
 * `key` and `values`. cycle: the predicted cycle time, s.
 */
export interface DryRunHead {
  number: number;
  project_id: string;
  project_name: string;
  revision: number;
  state: DryRunState;
  started: string;
  started_by?: string;
  from_action?: string;
  error?: string;
  cycle?: number;
  key?: string;
  values?: Record<string, string | Message>;
}

/** The first action that would fail. reason: a sentence. pose: pose in the world at which it fails. */
export interface DryRunProblem {
  action_id: string;
  name: string;
  reason: string;
  pose?: Pose;
  key?: string;
  values?: Record<string, string | Message>;
}

/** State of a dry run. */
export type DryRunState = "running" | "finished" | "failed" | "cancelled";

/**
 * Source of the duration of an action.
 *
 * planned: the timing of its planned motion. action: the median of this action in earlier runs. method: the median of
 * other actions of the same object type that call the same method. unknown: no duration is known, and 0 s are counted.
 */
export type DurationSource = "planned" | "action" | "method" | "unknown";

/** Pose of one end effector in the world. */
export interface EefPose {
  end_effector_id: string;
  pose: Pose;
  arm_id?: string;
}

/**
 * Overall equipment effectiveness (ISO 22400-2): each 0 to 1, omitted where it cannot be computed.
 *
 * availability: time running / time of the period. performance: planned time of the produced units / time running,
 * which is above 1 if the cell is faster than planned. quality: good / produced units. oee: their product.
 */
export interface Effectiveness {
  availability?: number;
  performance?: number;
  quality?: number;
  oee?: number;
}

/** Arguments of EndForce: a force of any client. */
export interface EndForceArgs {
  id: string;
}

/** A pose with its quality, 0 to 1. */
export interface EstimatedPose {
  pose: Pose;
  quality: number;
}

/** Arguments of ExecuteAction. */
export interface ExecuteActionArgs {
  action_id: string;
}

/** How a file of a package differs. */
export type FileChange = "added" | "removed" | "changed";

/**
 * Arguments of FindDevices: a type of devices, the setting whose values are searched, and the other settings.
 *
 * addresses: of a search in the network: addresses and networks, separated by commas or spaces.
 */
export interface FindDevicesArgs {
  type: string;
  setting: string;
  parameters?: Parameter[];
  addresses?: string;
}

/**
 * The alarm of a cell that needs a person first.
 *
 * device: its name; empty for the program and the system. translations: of its text, as far as a driver has them.
 */
export interface FirstAlarm {
  priority: Priority;
  text: string;
  raised: string;
  device: string;
  text_message?: Message;
  translations: Record<string, Record<string, string>>;
}

/** An alarm of a cell. id: of the result. at: when it was raised, s since the epoch. duration: s, up to now. */
export interface FleetAlarm {
  id: number;
  at: number;
  cell: string;
  duration: number;
  alarm: AlarmSummary;
}

/**
 * A cell on the page.
 *
 * id: of the card. alive: whether the cell has a signal. conflict: whether another server uses the same name or the
 * same data. seen: when the last state was received. state: the last state; its `number` and `boot` have no meaning.
 */
export interface FleetCard {
  id: string;
  name: string;
  alive: boolean;
  conflict: boolean;
  seen: string;
  state: FleetState;
}

/** Alarms of a cell with the same cause. newest: the last one of them. duration: sum, s. */
export interface FleetCause {
  cell: string;
  count: number;
  duration: number;
  newest: AlarmSummary;
}

/** Units of a cell, product and program that left the cell. product, program: empty if they are not known. */
export interface FleetCount {
  cell: string;
  product: string;
  program: string;
  good: number;
  bad: number;
  rejected: number;
}

/** What cells have produced. since, until: the period in whole quarters of an hour. step: length of its parts, s. */
export interface FleetProduction {
  since: number;
  until: number;
  step: number;
  counts: FleetCount[];
  times: FleetTime[];
}

/**
 * The state of a cell.
 *
 * identity: id of the data of the server. boot: id of the process of the server. number: counts the states of this
 * process. address: of its editor; empty if only its own computer reaches it. domain: JetStream domain in which its
 * results are stored. program: name of the running or last program. held: whether the program waits for a person after
 * a failed action. good, bad, rejected: units that left the cell in the last 8 hours. urgent, high, medium, low:
 * alarms that need attention. started_by: who started the running program. users: who is connected. controlling: who
 * of them has locked something, such as a robot. missing: names of devices that are not connected. waiting: results
 * that the broker has not stored yet.
 */
export interface FleetState {
  identity: string;
  boot: string;
  number: number;
  version: string;
  state: CellStateName;
  mode: CellMode;
  authority: CellAuthority;
  program_state: PackageStateEnum;
  address: string;
  domain: string;
  program: string;
  recipe: string;
  held: boolean;
  good: number;
  bad: number;
  rejected: number;
  urgent: number;
  high: number;
  medium: number;
  low: number;
  first_alarm?: FirstAlarm;
  started_by: string;
  users: string[];
  controlling: string[];
  missing: string[];
  waiting: number;
}

/** Units in a part of the period that begins `at`, s since the epoch. bad: with rejected ones. */
export interface FleetTime {
  at: number;
  good: number;
  bad: number;
}

/** A unit of a cell. id: of the result. at: when it left, s since the epoch. */
export interface FleetUnit {
  id: number;
  at: number;
  cell: string;
  unit: UnitSummary;
}

/** An update of the page. cells: changed cards. removed: ids of cards. broker: whether the broker is connected. */
export interface FleetUpdate {
  cells: FleetCard[];
  removed: string[];
  broker: boolean;
}

/**
 * Names of the results of an action; without names the results are not stored.
 *
 * Raises ValueError when an output name is repeated.
 */
export interface Flow {
  type: FlowTypes;
  outputs: string[];
}

/** Kinds of flow that leave an action. */
export type FlowTypes = "default";

/** The kind of value to which an output can be forced. */
export type ForceKind = "digital" | "analog";

/**
 * Arguments of ForcePoint.
 *
 * point: name of the output. value: a boolean for a digital output, a number in its unit for an analogue one.
 * valid_ms: 500 to 10000, duration of the force unless it is renewed.
 */
export interface ForcePointArgs {
  object_id: string;
  point: string;
  value: boolean | number;
  valid_ms: number;
}

/** Answer to ForcePoint: the id of the force. */
export interface ForcePointData {
  id: string;
}

/**
 * An output that a person forces.
 *
 * object, point: names of the device and of its output. unit: of the value. user: the user who forces it. since: start
 * of the force.
 */
export interface ForcedPoint {
  id: string;
  object_id: string;
  object: string;
  point: string;
  value: boolean | number;
  unit: string;
  user: string;
  since: string;
}

/** Data of the event ForcesChanged: all forced outputs. */
export interface ForcesChangedData {
  forces: ForcedPoint[];
}

/** Arguments of ForwardKinematics. */
export interface ForwardKinematicsArgs {
  robot_id: string;
  end_effector_id: string;
  joints: Joint[];
  arm_id?: string;
}

/** Answer to FindDevices: JSON of the setting's value that selects a device, and a description of the device. */
export interface FoundDevice {
  value: string;
  address: string;
  description: string;
  serial: string;
}

/**
 * A position in the program or in a function.
 *
 * action_id: the action that runs, or that is announced. function_id: the function that contains it; omitted in the
 * program itself. call_action_id: the action of the frame before this one that called the function.
 */
export interface Frame {
  action_id: string;
  function_id?: string;
  call_action_id?: string;
}

/**
 * A function with the functions that it calls, and the items to which their actions refer.
 *
 * functions: called functions come before their callers; the exported function is the last one.
 */
export interface FunctionExport {
  scene_id: string;
  functions: ProjectFunction[];
  references: NamedReference[];
}

/** A result of a function: its type, and the result `<action id>/default/<output index>` of one of its actions. */
export interface FunctionReturns {
  type: string;
  link: string;
}

/** Arguments of GetBreakpoints: the project, by default the open one. */
export interface GetBreakpointsArgs {
  project_id?: string;
}

/** Arguments of GetCameraPose. */
export interface GetCameraPoseArgs {
  camera_parameters: CameraParameters;
  image: string;
  inverse?: boolean;
}

/** Arguments of GetDryRun: the number of a dry run; default: the newest one of the open project. */
export interface GetDryRunArgs {
  number?: number;
}

/**
 * Answer to GetDryRun.
 *
 * prediction: the result, if the dry run has finished. outdated: whether the project was edited since. stored: the
 * dry runs of the project with a result, newest first.
 */
export interface GetDryRunData {
  dry_run: DryRunHead;
  outdated: boolean;
  stored: DryRunHead[];
  prediction?: Prediction;
}

/** Arguments of GetEndEffectorPose. */
export interface GetEndEffectorPoseArgs {
  robot_id: string;
  end_effector_id: string;
  arm_id?: string;
}

/** Arguments of GetEndEffectors. */
export interface GetEndEffectorsArgs {
  robot_id: string;
  arm_id?: string;
}

/** Arguments of GetExecutionTrace: maximum number of actions of the present or last run. */
export interface GetExecutionTraceArgs {
  limit?: number;
  before?: number;
}

/** Answer to GetExecutionTrace: the number of the run (0: none), and its actions, newest first. */
export interface GetExecutionTraceData {
  run: number;
  entries: TraceEntry[];
}

/** Arguments of GetGrippers. */
export interface GetGrippersArgs {
  robot_id: string;
  arm_id?: string;
}

/** Answer to GetHeld; `held` is omitted while the program is not held. */
export interface GetHeldData {
  held?: HeldData;
}

/** Arguments of GetProduction: the period, by default the last 8 hours. */
export interface GetProductionArgs {
  since?: string;
  until?: string;
}

/** Arguments of GetRobotArms. */
export interface GetRobotArmsArgs {
  robot_id: string;
}

/** Arguments of GetRobotJoints. */
export interface GetRobotJointsArgs {
  robot_id: string;
  arm_id?: string;
}

/** Arguments of GetSuctions. */
export interface GetSuctionsArgs {
  robot_id: string;
  arm_id?: string;
}

/** Arguments of GetUnit: number of the record. */
export interface GetUnitArgs {
  number: number;
}

/** Arguments of GetViewState; `user`: the user, by default the caller. */
export interface GetViewStateArgs {
  scope: ViewScope;
  document?: string;
  user?: string;
}

/** Arguments of HandTeachingMode. */
export interface HandTeachingModeArgs {
  robot_id: string;
  enable: boolean;
  arm_id?: string;
}

/** Data of the event HandTeachingMode. */
export interface HandTeachingModeData {
  robot_id: string;
  enabled: boolean;
  arm_id?: string;
}

/** Condition of a device (NAMUR NE 107). */
export type Health = "normal" | "check_function" | "off_spec" | "maintenance_required" | "failure";

/**
 * Data of the event Held: the action at which the program is held, its error, and the possible decisions.
 *
 * run: number of the run. number: of the action in the run. device: id of the object. kind: code of the error. text:
 * the error, with `key` and `values`. again: whether the action is safe to retry, or the person has to be asked;
 * omitted if a retry is not possible or nothing is repeated. returns: types of the results for the choice `result`.
 * exits: error exits for the choice `error_exit`. before: whether the action has not started, because the connection
 * of a device was lost.
 */
export interface HeldData {
  run: number;
  number: number;
  action_id: string;
  action_name: string;
  device: string;
  kind: string;
  text: string;
  choices: HoldChoice[];
  since: string;
  again?: Again;
  returns?: ResultType[];
  exits?: HoldExit[];
  before?: boolean;
  key?: string;
  values?: Record<string, string | Message>;
}

/** One lock: the locked item, its name if it has one, and the time. `type` is omitted for a read lock. */
export interface HeldLock {
  object_id: string;
  name: string;
  since: string;
  type?: LockType;
}

/** Arguments of History: maximum number, number before which edits are listed. */
export interface HistoryArgs {
  limit?: number;
  before?: number;
}

/** Data of the event HistoryChanged, for the user to whom it is sent. */
export interface HistoryChangedData {
  revision: number;
  undo?: HistoryStep;
  redo?: HistoryStep;
}

/**
 * Answer to History: the present revision, the oldest one that can be restored, and edits, newest first.
 *
 * `undo` and `redo` are the edits that these requests of the caller would revert.
 */
export interface HistoryData {
  revision: number;
  oldest: number;
  edits: HistoryEdit[];
  undo?: number;
  redo?: number;
}

/** One edit. `of` is the edit that an undo or redo reverted or that started the step, or the restored revision. */
export interface HistoryEdit {
  number: number;
  time: string;
  user: string;
  request: string;
  how: string;
  in_force: boolean;
  items: HistoryItem[];
  touched: number;
  of?: number;
}

/** One item changed by an edit; `name` is empty for items without a name. */
export interface HistoryItem {
  kind: string;
  id: string;
  name: string;
  change: string;
}

/**
 * The edit that the next undo or redo of a user reverts.
 *
 * request: request that made the edit. text: label of the button, without `Undo` or `Redo`.
 */
export interface HistoryStep {
  number: number;
  request: string;
  text: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * The continuation of a held program.
 *
 * RETRY repeats the action, or starts it if the program is held before it. RESULT continues with results that a person
 * supplies. SKIP continues as if an action without results had succeeded. ERROR_EXIT takes an error exit although it
 * does not name this error. END ends the program with the error.
 */
export type HoldChoice = "retry" | "result" | "skip" | "error_exit" | "end";

/** Data of the event HoldDecided: the decision about the action with this number, and its author. */
export interface HoldDecidedData {
  run: number;
  number: number;
  choice: HoldChoice;
  by: string;
}

/** An error exit: id of its logic item, the kinds that it names, and the name of the next action (empty: END). */
export interface HoldExit {
  id: string;
  kinds: string[];
  next: string;
}

/** Arguments of HoldHandTeaching; `hold`, `sent_ms` and `valid_ms` as in JogRobot. */
export interface HoldHandTeachingArgs {
  robot_id: string;
  hold: number;
  sent_ms: number;
  valid_ms: number;
  arm_id?: string;
}

/** Kind of motion that lasts only while a user holds a button. */
export type HoldKind = "jog" | "hand_teaching";

/** Arguments of every RPC that takes one id. */
export interface IdArgs {
  id: string;
}

/** A value with the id of its owner. */
export interface IdValue {
  id: string;
  value: string;
}

/** Identity of a device; unknown fields are empty. */
export interface Identity {
  vendor: string;
  model: string;
  serial: string;
  firmware: string;
}

/**
 * Arguments of ImportFunction.
 *
 * points: the action points of the open project, by the id or name of the exported ones. Other items are found by
 * their id, otherwise by their name.
 */
export interface ImportFunctionArgs {
  function: FunctionExport;
  points?: Record<string, string>;
}

/** Answer to ImportFunction: the ids of the new functions, in the order of the export. */
export interface ImportFunctionData {
  ids: string[];
}

/** Answer to ImportScript: the new revision, and the changed items. */
export interface ImportScriptData {
  revision: number;
  changes: HistoryItem[];
}

/**
 * Conditions for actions of an object, or for a zone.
 *
 * object_id: the object, or the collision body that is the zone. A zone belongs to one robot at a time. actions: names
 * of actions of the object; none for all its actions and motions. during: whether the conditions are needed as long as
 * the action runs, or a robot moves in the zone. within: longest time for which an action waits, s. retract: path on
 * which a robot leaves the zone, points in the frame of the body, the last one outside; none for the shortest path.
 */
export interface Interlock {
  name: string;
  on: InterlockTarget;
  object_id: string;
  actions: string[];
  needs: Need[];
  during: boolean;
  within: number;
  else: Unmet;
  id: string;
  retract: Position[];
}

/** Whether the conditions of an interlock are met. Unknown counts as not met. */
export type InterlockCondition = "met" | "not_met" | "unknown";

/**
 * The present state of an interlock.
 *
 * text: the first condition that is not met. owner: id of the robot that has the zone. waiting: ids of the objects
 * whose actions wait. inside: ids of the robots whose end effectors are in the zone.
 */
export interface InterlockState {
  id: string;
  state: InterlockCondition;
  text: string;
  owner: string;
  waiting: string[];
  inside: string[];
  key?: string;
  values?: Record<string, string | Message>;
}

/** The states of all interlocks of the online scene, or of the running program; none while it is offline. */
export interface InterlockStates {
  interlocks: InterlockState[];
}

/** Target of an interlock: actions of an object, or a zone. */
export type InterlockTarget = "action" | "zone";

/** Arguments of InverseKinematics. */
export interface InverseKinematicsArgs {
  robot_id: string;
  end_effector_id: string;
  pose: Pose;
  start_joints?: Joint[];
  avoid_collisions?: boolean;
  arm_id?: string;
}

/** The frame whose axes are used for jogging. The moving point is always the end effector. */
export type JogFrame = "world" | "robot" | "tool" | "user";

/**
 * Arguments of JogRobot: a velocity of the end effector (`linear` m/s, `angular` rad/s), or of joints (rad/s, m/s).
 *
 * hold: number of this press of the button, larger than the previous one; renewals have the same number. sent_ms: time
 * of sending by the sender's own steady clock with any origin. valid_ms: 1 to 300, duration of the velocity unless it
 * is renewed; 0 ends it. object_id, pose: for the frame `user`, an object of the scene, or a pose in the world.
 * retract: leave the zone in which the robot is, on its retract path, instead of a velocity.
 */
export interface JogRobotArgs {
  robot_id: string;
  hold: number;
  sent_ms: number;
  valid_ms: number;
  frame?: JogFrame;
  linear?: Position;
  angular?: Position;
  joints?: Joint[];
  object_id?: string;
  pose?: Pose;
  end_effector_id?: string;
  arm_id?: string;
  retract?: boolean;
}

/** Answer to JogRobot: the fraction of the requested velocity that is used, less than 1 where it is limited. */
export interface JogRobotData {
  scale: number;
}

/** The value of a joint, rad, m where prismatic. */
export interface Joint {
  name: string;
  value: number;
}

/** Arguments of ListAlarms: selection of records, maximum number, upper limit of the record number, object, run. */
export interface ListAlarmsArgs {
  show?: AlarmFilter;
  limit?: number;
  before?: number;
  object_id?: string;
  run?: number;
}

/** Answer to ListAlarms: records, newest first. */
export interface ListAlarmsData {
  alarms: AlarmRecord[];
}

/** Arguments of ListCalibrations: maximum number, latest date, object, kind. */
export interface ListCalibrationsArgs {
  limit?: number;
  object_id?: string;
  kind?: CalibrationKind;
  before?: string;
}

/** Answer to ListCalibrations: records, newest first. */
export interface ListCalibrationsData {
  records: CalibrationRecord[];
}

/** Answer to ListDeviceCards, by name. */
export interface ListDeviceCardsData {
  devices: DeviceCard[];
}

/** Answer to ListInterlocks: the interlocks of the open scene, and their states while they are known. */
export interface ListInterlocksData {
  interlocks: Interlock[];
  states: InterlockState[];
}

/**
 * Answer to ListPersons.
 *
 * Args:
 *     persons: all persons, by name.
 *     shared: whether this connection needs a person who logs on.
 *     needs_administrator: whether this connection may send CreateAdministrator.
 *     logged_on: id of the person who is logged on at this connection.
 */
export interface ListPersonsData {
  persons: Person[];
  shared: boolean;
  needs_administrator: boolean;
  logged_on?: string;
}

/** Answer to ListProjects; `problem_messages` as in ListScenes. */
export interface ListProjectsData {
  name: string;
  scene_id: string;
  description: string;
  has_logic: boolean;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
  problems?: string[];
  problem_messages?: Message[];
}

/** Arguments of ListRecipes: only those of a product, or in a state. */
export interface ListRecipesArgs {
  product?: string;
  state?: RecipeState;
}

/** Answer to ListRecipes: recipes by product, newest revision first, and the present production of the cell. */
export interface ListRecipesData {
  recipes: Recipe[];
  changeover: Changeover;
}

/** Arguments of ListRuns: maximum number, number before which runs are listed, package or project. */
export interface ListRunsArgs {
  limit?: number;
  before?: number;
  package_id?: string;
  project_id?: string;
}

/** Answer to ListRuns: runs, newest first. */
export interface ListRunsData {
  runs: Run[];
}

/** Answer to ListScenes. `problem_messages`: the problems with keys and values for translation, if requested. */
export interface ListScenesData {
  id: string;
  name: string;
  created: string;
  modified: string;
  description?: string;
  problems?: string[];
  problem_messages?: Message[];
}

/**
 * Arguments of ListUnits: selection of units, newest first.
 *
 * serial: the beginning of the serial number; case is ignored. order, product, run, state: all must match.
 * since, until: of entering the cell. before: number of a record.
 */
export interface ListUnitsArgs {
  serial?: string;
  order?: string;
  product?: string;
  run?: number;
  state?: UnitState;
  since?: string;
  until?: string;
  before?: number;
  limit?: number;
}

/** Answer to ListUnits: units without steps, newest first. */
export interface ListUnitsData {
  units: Unit[];
}

/**
 * A point of a device with its newest known value.
 *
 * name: the user's name of an input or output; of a signal, the name of its method or English words. age: of the
 * value, s; omitted if it is not known. force: the kind of value to which the point can be forced; omitted if it
 * cannot be forced.
 */
export interface LivePoint {
  name: string;
  use: PointUse;
  value: boolean | number | string | null;
  unit: string;
  quality: PointQuality;
  age?: number;
  force?: ForceKind;
}

/** Data of the events ObjectsLocked and ObjectsUnlocked. */
export interface LockData {
  object_ids: string[];
  owner: string;
}

/** A user with locks. `left` is the time of the disconnect; omitted while the user is connected. */
export interface LockHolder {
  user: string;
  locks: HeldLock[];
  left?: string;
}

/**
 * Wrong PINs of a person at a device.
 *
 * Args:
 *     device: name of the token of the device, or its address.
 *     wrong: number of wrong PINs since the last log-on there.
 *     until: when the person can try again there; unset if they can try now.
 */
export interface LockOut {
  device: string;
  wrong: number;
  until?: string;
}

/** Kinds of write lock. */
export type LockType = "TREE" | "OBJECT";

/** Arguments of LogOn: `person` (an id) and `pin`, or `card`, or `session` of an earlier answer. */
export interface LogOnArgs {
  person?: string;
  pin?: string;
  card?: string;
  session?: string;
}

/**
 * Data of LogOnChanged: the person who is logged on at the connection, and the reason of a log-off.
 *
 * Args:
 *     role: the role of the connection.
 *     person: the person; unset if nobody is logged on.
 *     reason: reason why the server logged the person off; empty otherwise.
 */
export interface LogOnChangedData {
  role: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  person?: Person;
  reason: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Answer to LogOn.
 *
 * Args:
 *     person: the person who is logged on.
 *     role: the role of this connection, the lower one of the person and of the token.
 *     session: a secret by which this device logs the person on again after a lost connection, and for REST.
 *     log_off_after: time without activity after which the person is logged off, s; 0: never.
 */
export interface LogOnData {
  person: Person;
  role: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  session: string;
  log_off_after: number;
}

/**
 * A comparison of a value with a constant, or with another value.
 *
 * `what` is `<action id>/default/<output index>`, or the id of a project parameter. `value`, and `upper` of a range,
 * are JSON in a string. `other` is another value in the form of `what`; `value` is empty then.
 */
export interface LogicComparison {
  what: string;
  operator: Operator;
  value: string;
  upper?: string;
  other?: string;
}

/**
 * A step from one action to the next, taken when its condition holds.
 *
 * `when` is a condition that compares several values; `condition` is then unset. With `error_kinds` it is an error
 * exit: it is taken when the action fails with an error of one of these kinds.
 */
export interface LogicItem {
  start: string;
  end: string;
  condition?: ProjectLogicIf;
  id: string;
  error_kinds?: string[];
  when?: LogicWhen;
}

/** A condition of one or several comparisons. */
export interface LogicWhen {
  comparisons: LogicComparison[];
  match: Match;
}

/** Values of WhatEnum in ShowMainScreen. */
export type MainScreen = "ScenesList" | "ProjectsList" | "PackagesList";

/**
 * Arguments of MakeFunction: the name of the function, its actions, and the name of the action that calls it.
 *
 * `call_name`: by default the name of the function, with a number if an action has it.
 */
export interface MakeFunctionArgs {
  name: string;
  action_ids: string[];
  call_name?: string;
}

/** Answer to MakeFunction: the function, and the action that calls it. */
export interface MakeFunctionData {
  function_id: string;
  action_id: string;
}

/** Arguments of MakeParallel: the name of the parallel action, and the calls that it runs at once. */
export interface MakeParallelArgs {
  name: string;
  action_ids: string[];
}

/** Answer to MakeParallel: the parallel action. */
export interface MakeParallelData {
  action_id: string;
}

/** The four corners of one marker. */
export interface MarkerCorners {
  marker_id: number;
  corners: Corner[];
}

/** Arguments of MarkersCorners. */
export interface MarkersCornersArgs {
  camera_parameters: CameraParameters;
  image: string;
}

/** Whether all comparisons have to be true, or any of them. */
export type Match = "all" | "any";

/** A mesh stored as an asset, with focus points for aiming with a robot. */
export interface Mesh {
  id: string;
  asset_id: string;
  focus_points?: Pose[];
}

/**
 * A text for users with the data for its translation. `str(message)` is the text.
 *
 * Attributes:
 *     text: The English text.
 *     key: The template of the text with plain `{name}` fields. It is the key of translations.
 *     values: The values of the fields, by name: formatted texts, or messages that are part of this one. Without
 *         values, `key` is the text itself.
 */
export interface Message {
  text: string;
  key: string;
  values?: Record<string, string | Message>;
}

/** Kinds of collision model. */
export type Model3dType = "None" | "Box" | "Cylinder" | "Sphere" | "Mesh";

/** Phases of a motion. */
export type MoveEventType = "start" | "end" | "failed";

/**
 * Pose of an item that a user is dragging, relative to its parent, as it would be stored.
 *
 * id: id of an object, action point, orientation or joints. Without position, orientation and joints, dragging has
 * ended.
 */
export interface MovePreview {
  id: string;
  position?: Position;
  orientation?: Orientation;
  joints?: Joint[];
}

/** Data of the event MovePreview. */
export interface MovePreviewData {
  id: string;
  position?: Position;
  orientation?: Orientation;
  joints?: Joint[];
  user: string;
}

/** Arguments of MoveToActionPoint. */
export interface MoveToActionPointArgs {
  robot_id: string;
  speed: number;
  end_effector_id?: string;
  orientation_id?: string;
  joints_id?: string;
  safe?: boolean;
  linear?: boolean;
  arm_id?: string;
}

/** Arguments of MoveToJoints. */
export interface MoveToJointsArgs {
  robot_id: string;
  speed: number;
  joints: Joint[];
  safe?: boolean;
  arm_id?: string;
}

/** Arguments of MoveToPose. */
export interface MoveToPoseArgs {
  robot_id: string;
  end_effector_id: string;
  speed: number;
  position?: Position;
  orientation?: Orientation;
  safe?: boolean;
  linear?: boolean;
  arm_id?: string;
}

/** An orientation of an action point. */
export interface NamedOrientation {
  name: string;
  orientation: Orientation;
  id: string;
}

/**
 * An item to which the actions of an exported function refer.
 *
 * kind: pose, position, joints, object or project_parameter. point_id, point: id and name of the action point of a
 * pose, position or joints. type: object type, or type of a project parameter. robot_id: the robot of joints.
 */
export interface NamedReference {
  kind: string;
  id: string;
  name: string;
  point_id?: string;
  point?: string;
  type?: string;
  robot_id?: string;
}

/**
 * A condition: an observation of an object, compared with a constant.
 *
 * observation: name of the observation in the metadata of the type. point: name of the point, for an observation of
 * many points. value, and upper of a range: JSON in a string.
 */
export interface Need {
  object_id: string;
  observation: string;
  operator: Operator;
  value: string;
  upper?: string;
  point: string;
}

/** Arguments of NewProject. */
export interface NewProjectArgs {
  scene_id: string;
  name: string;
  description?: string;
  has_logic?: boolean;
}

/** Arguments of NewScene. */
export interface NewSceneArgs {
  name: string;
  description?: string;
}

/** The last error of a node: its text and time. `key` and `values` translate the text. */
export interface NodeError {
  text: string;
  at: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * The scene or program that runs on a node.
 *
 * kind: `scene` or `program`; empty while it is being opened. name: of the scene; of a program, the id of its package.
 * since: time of its start.
 */
export interface NodeSession {
  kind: string;
  name: string;
  since: string;
}

/** Whether a node can be used. */
export type NodeState = "connected" | "silent" | "other_version";

/**
 * A node according to its last announcement.
 *
 * Attributes:
 *     name: Its name.
 *     state: Whether it can be used.
 *     version: Version of its installation; empty if it has never announced itself.
 *     computer: Name of the computer.
 *     since: Start of its service. This and all following fields are omitted if it has never announced itself.
 *     seen: Time of its last announcement, for a silent node.
 *     load: Average load of the last minute, per processor core: 1 for as many running tasks as cores.
 *     free: Free space of its disk, bytes.
 *     sessions: The scene or program that runs on it.
 *     error: Its last error since its start.
 *     objects: Names of the objects of the open scene that run on it.
 */
export interface NodeStatus {
  name: string;
  state: NodeState;
  version: string;
  computer: string;
  since?: string;
  seen?: string;
  load?: number;
  free?: number;
  sessions: NodeSession[];
  error?: NodeError;
  objects: string[];
}

/**
 * The nodes of a server.
 *
 * Attributes:
 *     configured: Whether the server uses nodes: it has a broker, or its cell file or the open scene names a node.
 *     nodes: The nodes by name: those that announced themselves, and those that the open scene or the cell file names.
 *     assigned: The nodes that the cell file of the server sets, by name of the object. They override those of scenes.
 *     problem: Reason why the state of the nodes is unknown; `key` and `values` translate it.
 *     apart: Reason why the objects of the open scene cannot work together across their nodes (`several_nodes`).
 */
export interface NodesData {
  configured: boolean;
  nodes: NodeStatus[];
  assigned: Record<string, string>;
  problem?: string;
  apart?: Message;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event Notification. */
export interface NotificationData {
  message: string;
  level: NotificationLevel;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Values of Level in Notification. */
export type NotificationLevel = "Info" | "Warn" | "Error";

/**
 * One action of an object type; category, icon, former_names, key and values are not in ARCOR2.
 *
 * former_names: names in older projects.
 */
export interface ObjectAction {
  name: string;
  description?: string;
  parameters: ParameterMeta[];
  meta: ActionMetadata;
  origins?: string;
  returns: string[];
  category?: string;
  icon?: string;
  former_names?: string[];
  key?: string;
  values?: Record<string, string | Message>;
  disabled: boolean;
  problem?: string;
}

/** Arguments of ObjectAimingAddPoint. */
export interface ObjectAimingAddPointArgs {
  point_idx: number;
}

/** Answer to ObjectAimingAddPoint. */
export interface ObjectAimingAddPointData {
  finished_indexes: number[];
}

/** Arguments of ObjectAimingStart. */
export interface ObjectAimingStartArgs {
  object_id: string;
  robot: RobotArg;
}

/**
 * Data of the event ObjectHealth: condition, alarms and owner of control of an object of the online scene.
 *
 * control_owner: "us", the name of another client, or omitted when nobody has control.
 */
export interface ObjectHealthData {
  object_id: string;
  health: Health;
  alarms: Alarm[];
  control_owner?: string;
}

/** One model, named by its kind. Raises ValueError unless exactly the field of that kind is set. */
export interface ObjectModel {
  type: Model3dType;
  box?: Box;
  cylinder?: Cylinder;
  sphere?: Sphere;
  mesh?: Mesh;
}

/**
 * Data of the event ObjectObservations: present values of a device.
 *
 * time_ms: time of reading on the steady clock of the cell. reason: why no value is known.
 */
export interface ObjectObservationsData {
  object_id: string;
  time_ms: number;
  observations: Observation[];
  reason?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Data of the event ObjectPoints: all points of a device.
 *
 * time_ms: time of reading on the steady clock of the cell. reason: why the points are not known.
 */
export interface ObjectPointsData {
  object_id: string;
  time_ms: number;
  points: LivePoint[];
  reason?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Data of the event ObjectState: the connection of an object of the online scene or the running program.
 *
 * reason: why the connection is lost or failed, or why all connections ended. overlaid: settings from the server's
 *     cell file.
 * answering: false while the process that controls the devices does not answer; `state` is then the last known one.
 */
export interface ObjectStateData {
  object_id: string;
  state: Connection;
  reason?: string;
  overlaid?: string[];
  answering?: boolean;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Metadata of an object type; all fields from display_name on, key and values are not in ARCOR2.
 *
 * display_name: name for users; omitted when the type declares none.
 * built_in: a base class or an installed type, which cannot be deleted. shadows: distribution and version of the
 * installed type of the same name that this uploaded type replaces. observable: whether StreamObservations returns
 * values of its objects. observations: those that interlocks compare.
 */
export interface ObjectTypeMeta {
  type: string;
  description: string;
  built_in: boolean;
  base: string;
  object_model?: ObjectModel;
  needs_parent_type?: string;
  has_pose: boolean;
  abstract: boolean;
  settings: ParameterMeta[];
  modified?: string;
  display_name?: string;
  category?: string;
  icon?: string;
  shadows?: string;
  observable?: boolean;
  observations?: ObservationMeta[];
  key?: string;
  values?: Record<string, string | Message>;
  disabled: boolean;
  problem?: string;
}

/**
 * Data of the event ObjectValues: visible state of a device, such as an open door. Missing values are unknown.
 *
 * values: by name, in SI units, such as the width of a gripper; 1 for on. parts: carried by a robot.
 */
export interface ObjectValuesData {
  object_id: string;
  values: Record<string, number>;
  parts: CarriedPart[];
}

/**
 * A value of a device for display and trends. It is None if its quality is bad.
 *
 * name: English words, which clients translate, or the user's name of a point. unit: SI; empty for a boolean.
 */
export interface Observation {
  name: string;
  value: number | boolean | null;
  unit: string;
  quality: Quality;
}

/**
 * An observation that interlocks compare: name, parameter type of its value, and description.
 *
 * members: values of an enumeration, each as JSON. unit: SI; omitted without one. of_point: whether the observation
 * belongs to a point, such as an input of an I/O block, whose name the interlock states.
 */
export interface ObservationMeta {
  name: string;
  type: string;
  description: string;
  unit?: string;
  members?: string[];
  of_point?: boolean;
}

/** Reaction of a program if an action fails and no error exit applies: end, or hold until a person decides. */
export type OnError = "end" | "hold";

/** Data of the event OpenProject. */
export interface OpenProjectData {
  scene: Scene;
  project: Project;
}

/** Data of the event OpenScene. */
export interface OpenSceneData {
  scene: Scene;
}

/** Operators of comparisons. A range is an interval: `[` and `]` include the limit, `(` and `)` do not. */
export type Operator = "==" | "!=" | "<" | "<=" | ">" | ">=" | "[]" | "[)" | "(]" | "()";

/**
 * A unit quaternion x, y, z, w, normalized at construction.
 *
 * Raises ValueError for the zero quaternion and for numbers that are not finite.
 */
export interface Orientation {
  x: number;
  y: number;
  z: number;
  w: number;
}

/** Data of the event PackageInfo. */
export interface PackageInfoData {
  package_id: string;
  package_name: string;
  scene: Scene;
  project: Project;
  collision_models: CollisionModels;
}

/** The content of package.json that clients see. */
export interface PackageMeta {
  name: string;
  built: string;
  executed?: string;
}

/** Answer to GetPackageParameters: constants and variables of the project of a package, whose values can be set. */
export interface PackageParametersData {
  parameters: ProjectParameter[];
}

/** Data of the event PackageState. */
export interface PackageStateData {
  state: PackageStateEnum;
  package_id?: string;
}

/** States of the execution (protocol, section 12.3). */
export type PackageStateEnum = "started" | "running" | "stopping" | "stopped" | "pausing" | "paused" | "resuming" | "undefined";

/** One package. */
export interface PackageSummary {
  id: string;
  package_meta: PackageMeta;
  project_meta?: ProjectMeta;
}

/** A named value; `value` is a JSON document in a string. */
export interface Parameter {
  name: string;
  type: string;
  value: string;
}

/** The parameters of a device in the form of the file. Fields as in BackupInfo. */
export interface ParameterBackup {
  object_type: string;
  identity: Identity;
  at: string;
  parameters: DeviceParameter[];
  digest: string;
}

/** A parameter with different values in a backup and in the device. A missing value is omitted. */
export interface ParameterDifference {
  name: string;
  backup?: boolean | number | string;
  device?: boolean | number | string;
  unit: string;
}

/** A parameter that could not be written, and the reason. */
export interface ParameterFailure {
  name: string;
  reason: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * One parameter of an action or setting; `extra` and `default_value` are JSON in strings.
 *
 * former_names (not in ARCOR2): names in older projects. secret: the value of this setting is stored by the server and
 * never sent to clients. address: whether this setting contains the address of the device; omitted when its name
 * decides. for_control: whether the device can only be observed while this setting has its default value.
 * found_by: the search (arcor2_hw.data.discovery.Search) that finds values of this setting.
 */
export interface ParameterMeta {
  name: string;
  type: string;
  dynamic_value: boolean;
  dynamic_value_parents?: string[];
  description?: string;
  default_value?: string;
  extra?: string;
  former_names?: string[];
  secret?: boolean;
  address?: boolean;
  for_control?: boolean;
  found_by?: string;
}

/**
 * A part in the cell.
 *
 * number: unique in the scene. serial: its code; empty before it is scanned. place: id of the place. moving_to: id of
 * the place where it may also be, because an action has not completed. good: result of its test. confirmed: whether
 * the place is known; if not, a person has to confirm it.
 */
export interface Part {
  number: number;
  place: string;
  serial: string;
  moving_to?: string;
  good?: boolean;
  confirmed: boolean;
}

/** Counts since the scene was created: fed = good + bad + rejected + in_cell. */
export interface PartCounts {
  fed: number;
  good: number;
  bad: number;
  rejected: number;
  in_cell: number;
}

/** The parts of a scene, its places, the counts, and the last run. */
export interface PartInventory {
  scene_id: string;
  parts: Part[];
  places: Place[];
  counts: PartCounts;
  run?: RunCheckpoint;
}

/**
 * A person who logs on at shared devices.
 *
 * Args:
 *     id: id of the person.
 *     name: their name, which is unique.
 *     role: their role. The token of the device may lower it.
 *     pin: whether they log on with a PIN.
 *     card: whether they log on with a card.
 *     lock_outs: wrong PINs; only administrators receive them.
 */
export interface Person {
  id: string;
  name: string;
  role: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  pin: boolean;
  card: boolean;
  lock_outs: LockOut[];
}

/** Values of PivotEnum in UpdateObjectPoseUsingRobot. */
export type Pivot = "top" | "middle" | "bottom";

/**
 * A place of parts: id and name of its object, or of an action point that belongs to no object with a place.
 *
 * capacity: how many parts fit; 0: any number. parts: serial numbers of the newest parts in a box. sensed: whether the
 * sensor detects a part; omitted if there is no sensor, or if it was not read.
 */
export interface Place {
  id: string;
  name: string;
  kind: PlaceKind;
  capacity: number;
  parts: string[];
  sensed?: boolean;
}

/**
 * Kinds of places.
 *
 * A part comes into the cell by a FEEDER. A HOLDER is a fixture, a nest, a gripper or a machine. A part leaves the
 * cell in a box: GOOD, BAD or REJECTED, by which it is counted.
 */
export type PlaceKind = "feeder" | "holder" | "good" | "bad" | "rejected";

/**
 * The connection of the PLC.
 *
 * listening: address of the Modbus block. peer: address of the PLC that wrote last. alive: whether its life counter
 * changes.
 */
export interface PlcLink {
  listening: string;
  alive: boolean;
  peer?: string;
}

/** Reliability of the value of a point. */
export type PointQuality = "good" | "uncertain" | "stale" | "bad" | "not_connected";

/** Kind of a point: an input or output of the device, one of its registers, or another reported value. */
export type PointUse = "input" | "output" | "register" | "signal";

/** Position and orientation of a frame in its parent frame. */
export interface Pose {
  position: Position;
  orientation: Orientation;
}

/** A point, or a displacement, m. */
export interface Position {
  x: number;
  y: number;
  z: number;
}

/**
 * The result of a dry run.
 *
 * trace: as of a real run, with the number 0; `error` of a span is the reason why the action would fail. durations:
 * the source of the duration of each action. problem: the first one, omitted if there is none.
 */
export interface Prediction {
  trace: RunTrace;
  summary: TraceSummary;
  durations: ActionDuration[];
  assumptions: Assumption[];
  problem?: DryRunProblem;
}

/**
 * The items that a user views and edits, as reported by the client.
 *
 * document: id of the viewed scene, project or package. selected, aimed, editing: ids in it. view: name of the screen
 * or view. camera: camera pose in the world, as a camera frame.
 */
export interface Presence {
  document: string;
  selected: string[];
  aimed?: string;
  editing?: string;
  view: string;
  camera?: Pose;
}

/** Urgency of an alarm (ISA-18.2), lowest first. */
export type Priority = "low" | "medium" | "high" | "urgent";

/** Data of the event ProcessState. */
export interface ProcessStateData {
  id: string;
  state: ProcessStateEnum;
  message?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Values of StateEnum in ProcessState. */
export type ProcessStateEnum = "started" | "finished" | "failed";

/** The production of the cell in a period, and the time per activity, s. */
export interface Production {
  since: string;
  until: string;
  counts: UnitCounts;
  seconds: Record<string, number>;
  effectiveness: Effectiveness;
}

/**
 * The position of a program; without branches no action has been announced, or the run has ended.
 *
 * run: number of the run; 0 before the first one.
 */
export interface ProgramPosition {
  run: number;
  branches: Branch[];
}

/** End of a step: before the next action of the same function or a caller, of any function, or of a caller. */
export type ProgramStep = "over" | "into" | "out";

/**
 * A project with its content.
 *
 * `script` is the program in Python as a person has edited it. Build uses its comments and formatting.
 */
export interface Project {
  name: string;
  scene_id: string;
  description: string;
  has_logic: boolean;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
  action_points: ActionPoint[];
  parameters: ProjectParameter[];
  functions: ProjectFunction[];
  logic: LogicItem[];
  object_overrides: SceneObjectOverride[];
  project_objects_ids?: string[];
  script?: string;
}

/** The shared breakpoints of a project: ids of its action points and actions, and the user of the last change. */
export interface ProjectBreakpoints {
  project_id: string;
  ids: string[];
  user?: string;
}

/** Data of the event ProjectException; action_id (not in ARCOR2): the action that failed. */
export interface ProjectExceptionData {
  message: string;
  type: string;
  handled: boolean;
  action_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * A named group of actions with logic of its own, which actions of type `<function id>/call` call.
 *
 * `type` of a parameter is the name of a parameter type. Its `value` has no meaning, and is empty.
 */
export interface ProjectFunction {
  name: string;
  actions: Action[];
  logic: LogicItem[];
  parameters: ActionParameter[];
  returns: FunctionReturns[];
  id: string;
}

/** A condition: `what` is `<action id>/default/<output index>`, `value` JSON in a string. */
export interface ProjectLogicIf {
  what: string;
  value: string;
}

/** The project that a package was built from. */
export interface ProjectMeta {
  id: string;
  name: string;
  description: string;
  modified: string;
}

/**
 * A constant of the project, or a variable with its value at the start of a run.
 *
 * Actions store results in a variable by giving the result its name.
 */
export interface ProjectParameter {
  name: string;
  type: string;
  value: string;
  range?: Range;
  display_name?: string;
  description?: string;
  id: string;
  variable?: boolean;
}

/** Joint values of one robot, stored at an action point; rad, m where prismatic. */
export interface ProjectRobotJoints {
  name: string;
  robot_id: string;
  joints: Joint[];
  is_valid: boolean;
  arm_id?: string;
  end_effector_id?: string;
  id: string;
}

/**
 * Answer to ProjectScript: the script, and the revision of the project from which it was generated.
 *
 * `editable` is whether an edited script can be imported: if the project has logic.
 */
export interface ProjectScriptData {
  revision: number;
  script: string;
  editable: boolean;
}

/** Arguments of PutInterlock: a new interlock without an id, or a changed one. */
export interface PutInterlockArgs {
  interlock: Interlock;
}

/** Answer to PutInterlock. */
export interface PutInterlockData {
  id: string;
}

/** Arguments of PutParameterBackup: the device, and the contents of the file. */
export interface PutParameterBackupArgs {
  object_id: string;
  backup: ParameterBackup;
}

/**
 * Arguments of PutRecipe: a new draft, or a draft to change.
 *
 * id: the draft; omitted for a new revision of the product.
 */
export interface PutRecipeArgs {
  product: string;
  package_id: string;
  id?: string;
  values?: RecipeValue[];
  planned_rate?: number;
  note?: string;
}

/** Reliability of a reading (good, uncertain, bad, as in OPC UA). */
export type Quality = "good" | "uncertain" | "bad";

/** An inclusive range. */
export interface Range {
  min: number;
  max: number;
}

/** Reachability of a pose by an end effector. */
export type Reach = "reachable" | "near_limit" | "in_collision" | "out_of_reach" | "unknown";

/**
 * Reachability of an orientation or joints by an end effector. `reason` is a sentence if they are not reachable.
 *
 * `key` and `values` are those of the reason.
 */
export interface ReachOfItem {
  id: string;
  reach: Reach;
  reason?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Arguments of Reachability: robot, arm and end effector, by default all; items, by default all.
 *
 * ids: orientations and joints of the open project.
 */
export interface ReachabilityArgs {
  robot_id?: string;
  arm_id?: string;
  end_effector_id?: string;
  ids?: string[];
}

/**
 * Answer to Reachability for each end effector, and data of the event ReachabilityChanged.
 *
 * revision: revision of the document to which it applies. items: orientations and joints of the open project; in the
 * event, those that changed.
 */
export interface ReachabilityData {
  robot_id: string;
  end_effector_id: string;
  revision: number;
  items: ReachOfItem[];
  arm_id?: string;
}

/** Arguments of ReadLock. */
export interface ReadLockArgs {
  object_id: string;
}

/** Arguments of ReadUnlock. */
export interface ReadUnlockArgs {
  object_id: string;
}

/**
 * A revision of a recipe.
 *
 * revision: counts the recipes of the product, from 1. package_id, package_hash: the package, and the SHA-256 of its
 * files. values: values that replace those of the package. planned_rate: planned parts per hour. signatures: the first
 * one is the oldest.
 */
export interface Recipe {
  id: string;
  product: string;
  revision: number;
  package_id: string;
  package_hash: string;
  state: RecipeState;
  created: string;
  created_by: string;
  values: RecipeValue[];
  planned_rate?: number;
  note: string;
  signatures: Signature[];
}

/**
 * The differences of two recipes.
 *
 * script: unified diff of the scripts. problems: reasons why a recipe cannot be used, such as a changed package.
 */
export interface RecipeComparison {
  before: Recipe;
  after: Recipe;
  values: ChangedValue[];
  files: ChangedFile[];
  script: string;
  problems: string[];
}

/** State of a recipe. Each state after the first one is reached by a signature. */
export type RecipeState = "draft" | "tested" | "released" | "retired";

/**
 * The value of a constant or variable of the project, JSON in a string.
 *
 * min, max: limits within which the value of a single run may differ; without both, it may not.
 */
export interface RecipeValue {
  name: string;
  value: string;
  min?: number;
  max?: number;
}

/**
 * An alarm in a recording.
 *
 * number: of its record. time: time at which it was raised, ms after the event of the recording.
 */
export interface RecordedAlarm {
  number: number;
  time: number;
  text: string;
  text_message?: Message;
  object_id?: string;
  object_name?: string;
}

/**
 * A recording was stored or has changed.
 *
 * deleted: numbers of the recordings that were deleted because there are newer ones.
 */
export interface RecordingChangedData {
  recording: RecordingInfo;
  deleted: number[];
}

/**
 * A stored recording without its values.
 *
 * number: of the recording, from 1. at: time of the event, to which all times are relative. stamp: the same on the
 * monotonic clock of the computer, s. begin, end: the recorded time, ms after the event. size: of its file, bytes.
 * complete: false while the recording continues, and for a recording that was cut off by the end of the server.
 *     run: number of the run; omitted in an online scene. run_failed: whether the run ended with an error or was
 *     interrupted. error: its reason.
 * alarms: the recorded ones, the event first.
 */
export interface RecordingInfo {
  number: number;
  at: string;
  stamp: number;
  begin: number;
  end: number;
  size: number;
  complete: boolean;
  run?: number;
  run_failed: boolean;
  error?: string;
  error_message?: Message;
  alarms: RecordedAlarm[];
}

/** Arguments of Redo: the undo of the caller, by default the latest one. */
export interface RedoArgs {
  number?: number;
}

/** Arguments of RegisterForRobotEvent. */
export interface RegisterForRobotEventArgs {
  robot_id: string;
  what: RobotEventKind;
  send: boolean;
}

/** Arguments of RegisterUser. */
export interface RegisterUserArgs {
  user_name: string;
}

/** Arguments of RemoveAction. With `with_steps`, its connections and parallel calls are removed in the same edit. */
export interface RemoveActionArgs {
  id: string;
  with_steps?: boolean;
}

/** Arguments of RemoveActionPointJoints. */
export interface RemoveActionPointJointsArgs {
  joints_id: string;
}

/** Arguments of RemoveActionPointOrientation. */
export interface RemoveActionPointOrientationArgs {
  orientation_id: string;
}

/** Arguments of RemoveFromScene. */
export interface RemoveFromSceneArgs {
  id: string;
  force?: boolean;
}

/** Arguments of RemoveFunctionParameter. */
export interface RemoveFunctionParameterArgs {
  function_id: string;
  name: string;
}

/** Arguments of RemoveFunctionResult; `index` counts from 0. */
export interface RemoveFunctionResultArgs {
  function_id: string;
  index: number;
}

/** Arguments of RemoveLogicItem. */
export interface RemoveLogicItemArgs {
  logic_item_id: string;
}

/** Arguments of RemovePerson. */
export interface RemovePersonArgs {
  id: string;
}

/** Arguments of RemoveProjectParameter. */
export interface RemoveProjectParameterArgs {
  id: string;
}

/** Arguments of RenameAction. */
export interface RenameActionArgs {
  action_id: string;
  new_name: string;
}

/** Arguments of RenameActionPoint. */
export interface RenameActionPointArgs {
  action_point_id: string;
  new_name: string;
}

/** Arguments of RenameActionPointJoints. */
export interface RenameActionPointJointsArgs {
  joints_id: string;
  new_name: string;
}

/** Arguments of RenameActionPointOrientation. */
export interface RenameActionPointOrientationArgs {
  orientation_id: string;
  new_name: string;
}

/** Arguments of RenameScene and RenameObject. */
export interface RenameArgs {
  id: string;
  new_name: string;
}

/** Arguments of RenameFunction. */
export interface RenameFunctionArgs {
  function_id: string;
  new_name: string;
}

/** Arguments of RenamePackage. */
export interface RenamePackageArgs {
  package_id: string;
  new_name: string;
}

/** Arguments of RenameProject. */
export interface RenameProjectArgs {
  project_id: string;
  new_name: string;
}

/** Arguments of RenewForces: forces of this client, and their duration from now unless they are renewed again. */
export interface RenewForcesArgs {
  ids: string[];
  valid_ms: number;
}

/**
 * An action of the interrupted cycle at which the program can continue instead, so that it is repeated.
 *
 * at: its position in the cycle. text: reason why it cannot continue there; empty if it can.
 */
export interface Restart {
  at: number;
  action_id: string;
  name: string;
  text: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Answer to RestoreParameters: the number of written parameters, and those that could not be written. */
export interface RestoreParametersData {
  written: number;
  failures: ParameterFailure[];
}

/** Arguments of RestoreRevision: the number of the edit after which the document is restored. */
export interface RestoreRevisionArgs {
  revision: number;
}

/** Answer to RestoreRevision: the new revision. */
export interface RestoreRevisionData {
  revision: number;
}

/**
 * Type of a result that a person may supply: boolean, integer, double, string, integer_enum or string_enum.
 *
 * members: the values of an enumeration, JSON in a text.
 */
export interface ResultType {
  type: string;
  members: string[];
}

/** Maximum number of repetitions of a failed action, and the pause before each repetition, s. */
export interface Retry {
  count: number;
  pause: number;
}

/** Arguments of RetryObject. */
export interface RetryObjectArgs {
  object_id: string;
}

/** Names a robot's end effector. */
export interface RobotArg {
  robot_id: string;
  end_effector: string;
  arm_id?: string;
}

/** Data of the event RobotEef; `time_ms` (steady clock of the cell) is set if StreamRobot requested it. */
export interface RobotEefData {
  robot_id: string;
  end_effectors: EefPose[];
  time_ms?: number;
}

/** Values of RegisterEnum in RegisterForRobotEvent. */
export type RobotEventKind = "eef_pose" | "joints";

/** Optional methods that a robot type implements; the last three are not in ARCOR2. */
export interface RobotFeatures {
  move_to_pose: boolean;
  move_to_joints: boolean;
  stop: boolean;
  forward_kinematics: boolean;
  inverse_kinematics: boolean;
  hand_teaching: boolean;
  jog?: boolean;
  acknowledge_stop?: boolean;
  kinematic_calibration?: boolean;
}

/**
 * Data of the event RobotHold: a user started to hold a robot, or the hold ended and the robot is at standstill.
 *
 * reason: why it ended, unless the user released the button.
 */
export interface RobotHoldData {
  robot_id: string;
  kind: HoldKind;
  user: string;
  held: boolean;
  reason?: string;
  arm_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event RobotJoints; `time_ms` as in RobotEef. */
export interface RobotJointsData {
  robot_id: string;
  joints: Joint[];
  time_ms?: number;
}

/** Metadata of a robot type. */
export interface RobotMeta {
  type: string;
  robot_type: RobotType;
  multi_arm: boolean;
  features: RobotFeatures;
  urdf_package_filename?: string;
}

/** Data of the event RobotMoveToActionPointJoints. */
export interface RobotMoveToActionPointJointsData {
  move_event_type: MoveEventType;
  robot_id: string;
  joints_id: string;
  safe: boolean;
  message?: string;
  arm_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event RobotMoveToActionPointOrientation. */
export interface RobotMoveToActionPointOrientationData {
  move_event_type: MoveEventType;
  robot_id: string;
  end_effector_id: string;
  orientation_id: string;
  safe: boolean;
  linear: boolean;
  message?: string;
  arm_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event RobotMoveToJoints. */
export interface RobotMoveToJointsData {
  move_event_type: MoveEventType;
  robot_id: string;
  target_joints: Joint[];
  safe: boolean;
  message?: string;
  arm_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Data of the event RobotMoveToPose. */
export interface RobotMoveToPoseData {
  move_event_type: MoveEventType;
  robot_id: string;
  end_effector_id: string;
  target_pose: Pose;
  safe: boolean;
  linear: boolean;
  message?: string;
  arm_id?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Types of robot. */
export type RobotType = "articulated" | "cartesian" | "scara";

/**
 * One run of a package.
 *
 * project_modified: modification time of the built project, which identifies its revision. temporary: run from the
 * editor; its package is deleted. started_by, stopped_by: name of a user or token. actions: number of started actions.
 * last_action: action that was active at the end. error: error that ended the run, with `key` and `values` as in
 * ProjectException. statistics: omitted until the devices are connected, and in runs of older servers. recipe: the
 * recipe; omitted without one. order: id of the order that was given at the start.
 */
export interface Run {
  number: number;
  package_id: string;
  package_name: string;
  started: string;
  end: RunEnd;
  actions: number;
  temporary: boolean;
  start_paused: boolean;
  ended?: string;
  started_by?: string;
  stopped_by?: string;
  project_id?: string;
  project_name?: string;
  project_modified?: string;
  last_action?: ActionOfRun;
  error?: string;
  error_type?: string;
  statistics?: RunStatistics;
  recipe?: UsedRecipe;
  order?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * State of a run before or after an action.
 *
 * package_hash: SHA-256 of script and project. cycle: number of the present cycle, from 1. actions: those that have
 * started and not ended; empty between two actions. last: the action that ended last. results: the newest results of
 * each action by its id, in JSON. ended: whether the program has ended in an orderly way. done: the completed
 * actions of the present cycle. variables: the values of the program's variables at its start, by name, in JSON.
 * complete: whether `done` is complete. interrupted: whether the server has noticed that the run was interrupted.
 * confirmed: whether a person has since confirmed the places of all parts.
 * restarts: the actions before the interruption at which it can continue instead.
 * continues, continues_at: whether the program can continue, and at which actions (empty: after `last`). missing: name
 * of the action because of which it cannot.
 */
export interface RunCheckpoint {
  run: number;
  package_id: string;
  package_hash: string;
  since: string;
  cycle: number;
  actions: RunningAction[];
  last: string;
  results: Record<string, string[]>;
  ended: boolean;
  done: DoneAction[];
  variables: Record<string, string>;
  complete: boolean;
  interrupted: boolean;
  confirmed: boolean;
  continues: boolean;
  continues_at: string[];
  missing: string;
  restarts: Restart[];
}

/** Outcome of a run: completed, stopped by a user, failed, or ended with the server or its host. */
export type RunEnd = "running" | "finished" | "stopped" | "failed" | "lost";

/**
 * Arguments of RunPackage.
 *
 * shared_breakpoints: whether the breakpoints of the project (SetBreakpoints) are used in addition to `breakpoints`.
 * on_error: reaction of the program if an action fails and no error exit applies. checkpoints: whether the state is
 * stored before and after each action; default: true. continues: whether the program continues at the
 * interruption, which requires that it is held on errors. continue_at: position in the cycle of another action at
 * which it continues (see Restart). recipe_id: the recipe, whose package this must be.
 * recipe_values: values of this run by name, JSON in a string, within the limits of the recipe. order: id of the order
 * that is stored with the produced units.
 */
export interface RunPackageArgs {
  id: string;
  start_paused?: boolean;
  breakpoints?: string[];
  shared_breakpoints?: boolean;
  on_error?: OnError;
  checkpoints?: boolean;
  continues?: boolean;
  continue_at?: number;
  recipe_id?: string;
  recipe_values?: Record<string, string>;
  order?: string;
}

/**
 * Statistics of a run up to now.
 *
 * cycles: completed passes of the program from its start to its end. last_cycle, mean_cycle: durations of the last
 * cycle and of all cycles, s, without cycles during which the program was paused; omitted before the first one. good,
 * bad: results of actions that judge a part (`verdict`); omitted if the program has no such action. counters: counters
 * that the program has used. variables: all variables of the
 * project; omitted if it has none. held: time for which the program was held at failed actions, s; omitted for none.
 */
export interface RunStatistics {
  cycles: number;
  last_cycle?: number;
  mean_cycle?: number;
  good?: number;
  bad?: number;
  counters: CounterValue[];
  variables?: VariableValue[];
  held?: number;
}

/** Data of the event RunStatistics; `run` is the number of the run. */
export interface RunStatisticsData {
  cycles: number;
  last_cycle?: number;
  mean_cycle?: number;
  good?: number;
  bad?: number;
  counters: CounterValue[];
  variables?: VariableValue[];
  held?: number;
  run: number;
}

/**
 * The executed actions of a run in the order of their start, and their devices in the order of their first action.
 *
 * started: start of the first action. omitted: number of actions at the start of a long run that are not stored.
 */
export interface RunTrace {
  run: number;
  started?: string;
  devices: TracedDevice[];
  spans: Span[];
  omitted: number;
}

/**
 * An action that has started but not ended.
 *
 * number: in the run. branch, frames: its position, as in ProgramPosition.
 */
export interface RunningAction {
  number: number;
  action_id: string;
  action_name: string;
  branch: string;
  frames: Frame[];
}

/** A scene with its objects. `interlocks` (not in ARCOR2) is omitted if there are none. */
export interface Scene {
  name: string;
  description: string;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
  objects: SceneObject[];
  interlocks?: Interlock[];
}

/**
 * One object; `pose` is set exactly when its type has one.
 *
 * node (not in ARCOR2): name of the computer (`arcor2-hw node`) on which it runs; omitted if it needs none.
 */
export interface SceneObject {
  name: string;
  type: string;
  pose?: Pose;
  parameters: Parameter[];
  id: string;
  node?: string;
}

/** Settings of one scene object that a project overrides. */
export interface SceneObjectOverride {
  id: string;
  parameters: Parameter[];
}

/** Data of the event SceneState. */
export interface SceneStateData {
  state: SceneStateEnum;
  message?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Values of StateEnum in SceneState. */
export type SceneStateEnum = "stopped" | "starting" | "started" | "stopping";

/** Arguments of CheckScript and ImportScript: an edited script, and the revision of the script before. */
export interface ScriptArgs {
  script: string;
  revision: number;
}

/** The reason why a script cannot be imported. `line` and `column` from 1 are omitted for the whole script. */
export interface ScriptProblem {
  message: string;
  line?: number;
  column?: number;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Arguments of SetBreakpoints: ids of action points and actions, and the project, by default the open one. */
export interface SetBreakpointsArgs {
  add?: string[];
  remove?: string[];
  project_id?: string;
}

/** Arguments of SetCellAuthority. */
export interface SetCellAuthorityArgs {
  authority: CellAuthority;
}

/** Arguments of SetCellJobs: all jobs. */
export interface SetCellJobsArgs {
  jobs: CellJob[];
}

/** Arguments of SetCellMode. */
export interface SetCellModeArgs {
  mode: CellMode;
}

/** Arguments of SetEefPerpendicularToWorld. */
export interface SetEefPerpendicularToWorldArgs {
  robot_id: string;
  end_effector_id: string;
  safe?: boolean;
  speed?: number;
  linear?: boolean;
  arm_id?: string;
}

/** Arguments of SetObjectNode: the scene object, and the name of its node; empty for none. */
export interface SetObjectNodeArgs {
  id: string;
  node: string;
}

/** Arguments of SetViewState: values by key; null removes a value, other keys are unchanged. */
export interface SetViewStateArgs {
  scope: ViewScope;
  values: Record<string, unknown>;
  document?: string;
}

/** Answer to SetViewState: the new revision of the view state. */
export interface SetViewStateData {
  revision: number;
}

/** Severity of an alarm. */
export type Severity = "info" | "warning" | "error" | "critical";

/** Arguments of ShelveAlarm: number of the record, time in s (0 ends the shelving), and a note. */
export interface ShelveAlarmArgs {
  number: number;
  seconds: number;
  note?: string;
}

/** Data of the event ShowMainScreen. */
export interface ShowMainScreenData {
  what: MainScreen;
  highlight?: string;
}

/** Arguments of SignRecipe: the new state, and the person who signs, with their PIN. */
export interface SignRecipeArgs {
  id: string;
  state: RecipeState;
  person: string;
  pin: string;
  note?: string;
}

/**
 * A signature of a person.
 *
 * state: the state that it sets. person, name, role: the person who signed. at: time. meaning: meaning of the
 * signature. note: remark of the person. digest: SHA-256 of the recipe, the signature before, and all other fields.
 */
export interface Signature {
  state: RecipeState;
  person: string;
  name: string;
  role: "operator" | "standard_user" | "advanced_user" | "technician" | "programmer";
  at: string;
  meaning: string;
  note: string;
  digest: string;
}

/**
 * One executed action.
 *
 * number: number of the action in the run from 1, in the order of their start. device: id of the object. start: since
 * the first action of the run, s. duration: s. branch: value of the condition after which the action followed the one
 * before it, as JSON; omitted without a condition. error: reason why the action failed. thread_id: omitted in the main
 * thread of the script. call: number of the call of the function that contains the action; omitted in the program
 * itself. The span of a call has no device. attempt: number of the attempt of a retried action; omitted for the first
 * one. lane: id of the branch that executed the action at the same time as others; omitted in the program itself.
 * hold: the hold of the program at the action, which is not part of its duration.
 */
export interface Span {
  number: number;
  action_id: string;
  name: string;
  device: string;
  start: number;
  duration: number;
  branch?: string;
  error?: string;
  thread_id?: number;
  call?: number;
  attempt?: number;
  lane?: string;
  hold?: ActionHold;
}

/** A sphere around its origin, m. */
export interface Sphere {
  id: string;
  radius: number;
}

/**
 * Arguments of StartDryRun.
 *
 * from_action: first action; default: the one after START. branches: for actions with several branches, the id of the
 * next action, or END.
 */
export interface StartDryRunArgs {
  from_action?: string;
  branches?: Record<string, string>;
}

/** Arguments of StepAction; `branch` is the id of a branch of the program, by default the one that waits longest. */
export interface StepActionArgs {
  mode?: ProgramStep;
  branch?: string;
}

/** Values of Axis in StepRobotEef. */
export type StepAxis = "x" | "y" | "z";

/** Values of Mode in StepRobotEef. */
export type StepMode = "world" | "robot" | "user" | "relative";

/** Arguments of StepRobotEef. */
export interface StepRobotEefArgs {
  robot_id: string;
  end_effector_id: string;
  axis: StepAxis;
  what: StepWhat;
  mode: StepMode;
  step: number;
  safe?: boolean;
  pose?: Pose;
  speed?: number;
  linear?: boolean;
  arm_id?: string;
}

/** Values of What in StepRobotEef. */
export type StepWhat = "position" | "orientation";

/** Answer to StopAll: the result for each device, action or program that was stopped, or cannot be stopped. */
export interface StopAllData {
  outcomes: StopOutcome[];
}

/** What a stop applies to. */
export type StopKind = "device" | "action" | "program";

/**
 * The result of StopAll for one device, the action being executed, or the program.
 *
 * id, name: of the scene object, the action or the package. reason: why it was not stopped, with `key` and `values`.
 */
export interface StopOutcome {
  kind: StopKind;
  id: string;
  name: string;
  stopped: boolean;
  reason?: string;
  key?: string;
  values?: Record<string, string | Message>;
}

/** Arguments of StopRobot. */
export interface StopRobotArgs {
  robot_id: string;
}

/** Arguments of StreamObservations: ObjectObservations of a device, 0.2 to 10 times per second, or off. */
export interface StreamObservationsArgs {
  object_id: string;
  rate?: number;
  send?: boolean;
}

/** Arguments of StreamPoints: ObjectPoints of a device, 0.2 to 5 times per second, or off. */
export interface StreamPointsArgs {
  object_id: string;
  rate?: number;
  send?: boolean;
}

/** Arguments of StreamRobot: RobotJoints or RobotEef of a robot, 1 to 30 times per second, or off. */
export interface StreamRobotArgs {
  robot_id: string;
  what: RobotEventKind;
  rate?: number;
  send?: boolean;
}

/**
 * Arguments of SubscribeEvents: names of additional events to subscribe to, or to unsubscribe from.
 *
 * users: users whose view states are sent with ViewStateChanged, in addition to the user of this connection.
 */
export interface SubscribeEventsArgs {
  events: string[];
  send?: boolean;
  users?: string[];
}

/** Answer to SystemInfo. cell: left out if the cell has no name. */
export interface SystemInfoData {
  version: string;
  api_version: string;
  supported_parameter_types: string[];
  supported_rpc_requests: string[];
  cell?: CellInfo;
}

/** Arguments of TakeOverLocks: a disconnected user. */
export interface TakeOverLocksArgs {
  user: string;
}

/** Answer to TakeOverLocks: the released locks. */
export interface TakeOverLocksData {
  locks: HeldLock[];
}

/** Kind of a task. */
export type TaskKind = "scene_start" | "scene_stop" | "build" | "calibration" | "upload" | "download" | "computation";

/** Progress of a task. */
export type TaskProgress = "running" | "finished" | "failed" | "cancelled";

/**
 * Data of the event TaskState.
 *
 * title: sentence for users; title_message: the data for its translation. started_by: name of a user or token,
 * omitted when it was started automatically. progress: 0 to 1, omitted when unknown. message: present activity, or
 * reason of the failure.
 */
export interface TaskStateData {
  id: string;
  kind: TaskKind;
  title: string;
  state: TaskProgress;
  started: string;
  started_by?: string;
  progress?: number;
  message?: string;
  title_message?: Message;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * Arguments of TemporaryPackage.
 *
 * shared_breakpoints: whether the breakpoints of the project (SetBreakpoints) are used in addition to `breakpoints`.
 * on_error: reaction of the program if an action fails and no error exit applies. checkpoints: as in RunPackage.
 */
export interface TemporaryPackageArgs {
  start_paused?: boolean;
  breakpoints?: string[];
  shared_breakpoints?: boolean;
  on_error?: OnError;
  checkpoints?: boolean;
}

/**
 * One action of a run with its parameters, results and duration.
 *
 * number: number of the action in the run from 1, in the order of their start. started: time of the start. duration:
 * s, without a pause before it; omitted while it runs. parameters, results: as in ActionStateBefore and
 * ActionStateAfter. error: reason of a failure, with `key` and `values`. thread_id: omitted in the main thread of the
 * script. call: number of the call of the function that contains the action; omitted in the program itself. attempt:
 * number of the attempt of a retried action; omitted for the first one. hold: the hold of the program at the
 * action.
 */
export interface TraceEntry {
  run: number;
  number: number;
  action_id: string;
  started: string;
  name: string;
  duration?: number;
  parameters?: string[];
  results?: string[];
  error?: string;
  thread_id?: number;
  attempt?: number;
  call?: number;
  hold?: ActionHold;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * The times of a run, s.
 *
 * whole: from the start of the first action to the end of the last one. cycles: number of complete cycles; a cycle
 * lasts from the start of the first action to its next start. cycle: median of their durations; without a complete
 * cycle, the whole time. devices: the bottleneck, which is busy for the largest share, first. waits: longest first.
 * device_waits: the longest one of each device, in the order of the devices.
 */
export interface TraceSummary {
  whole: number;
  cycles: number;
  cycle: number;
  devices: DeviceTimes[];
  actions: ActionTimes[];
  waits: Wait[];
  device_waits: DeviceWait[];
}

/** A device of a trace. busy: sum of the durations of its actions, s. */
export interface TracedDevice {
  id: string;
  name: string;
  busy: number;
}

/** Arguments of GetActions. */
export interface TypeArgs {
  type: string;
}

/** Arguments of Undo: the edit of the caller, by default the latest one in effect. */
export interface UndoArgs {
  number?: number;
}

/** Answer to Undo and Redo: the reverted edit, the request that made it, and the new revision. */
export interface UndoData {
  number: number;
  request: string;
  revision: number;
}

/**
 * A unit that the cell has worked on, without its steps.
 *
 * number: of the record. serial: serial number; empty if it was never read. scene_id, part: the scene, and the number
 * of the part in the inventory. order: id of the order. entered, left: times at which it came into the cell and left
 * it.
 * verdict: result of its last test. runs: numbers of the runs that worked on it.
 */
export interface Unit {
  number: number;
  serial: string;
  scene_id: string;
  part: number;
  state: UnitState;
  entered: string;
  left?: string;
  verdict?: boolean;
  order: string;
  recipe?: UsedRecipe;
  package_id: string;
  package_name: string;
  package_hash: string;
  started_by: string;
  runs: number[];
}

/** Units that left the cell, and units that are in it. */
export interface UnitCounts {
  good: number;
  bad: number;
  rejected: number;
  unknown: number;
  in_cell: number;
}

/**
 * A unit with its steps, and the calibrations that were in force when it came into the cell.
 *
 * dropped: number of further steps that are not stored.
 */
export interface UnitRecord {
  number: number;
  serial: string;
  scene_id: string;
  part: number;
  state: UnitState;
  entered: string;
  left?: string;
  verdict?: boolean;
  order: string;
  recipe?: UsedRecipe;
  package_id: string;
  package_name: string;
  package_hash: string;
  started_by: string;
  runs: number[];
  steps: UnitStep[];
  calibrations: UsedCalibration[];
  dropped: number;
}

/**
 * Location of a unit: in the cell, in a box for good, bad or rejected parts, or unknown.
 *
 * REJECTED includes parts that a person has taken out of the cell. UNKNOWN: it left while the server was off, and the
 * inventory no longer contains its serial number.
 */
export type UnitState = "in_cell" | "good" | "bad" | "rejected" | "unknown";

/**
 * An action that concerned a unit.
 *
 * run, number: run, and number of the action in it. duration: s. parameters, results: each as JSON in a string. error:
 * reason of a failure, with `key` and `values`. attempt: number of the attempt, if not the first one.
 */
export interface UnitStep {
  run: number;
  number: number;
  action_id: string;
  name: string;
  started: string;
  duration?: number;
  parameters?: string[];
  results?: string[];
  error?: string;
  attempt?: number;
  key?: string;
  values?: Record<string, string | Message>;
}

/**
 * A unit without its steps.
 *
 * step, error: the action that explains why it is bad, and the error of this action; empty if there is none. message:
 * the error as a message, unless it is too long. translations: of the errors of all steps by the cell.
 */
export interface UnitSummary {
  number: number;
  serial: string;
  part: number;
  state: UnitState;
  entered: string;
  left?: string;
  verdict?: boolean;
  order: string;
  product: string;
  program: string;
  step: string;
  error: string;
  message?: Message;
  translations: Record<string, Record<string, string>>;
}

/** Reaction of an action to a condition that is not met: wait, then hold the program; or hold it at once. */
export type Unmet = "wait" | "hold";

/** Arguments of UpdateAction. */
export interface UpdateActionArgs {
  action_id: string;
  parameters?: ActionParameter[];
  flows?: Flow[];
  error_output?: string;
  retry?: Retry;
}

/** Arguments of UpdateActionPointJoints. */
export interface UpdateActionPointJointsArgs {
  joints_id: string;
  joints: Joint[];
}

/** Arguments of UpdateActionPointJointsUsingRobot. */
export interface UpdateActionPointJointsUsingRobotArgs {
  joints_id?: string;
}

/** Arguments of UpdateActionPointOrientation. */
export interface UpdateActionPointOrientationArgs {
  orientation_id: string;
  orientation: Orientation;
}

/** Arguments of UpdateActionPointOrientationUsingRobot. */
export interface UpdateActionPointOrientationUsingRobotArgs {
  orientation_id: string;
  robot: RobotArg;
}

/** Arguments of UpdateActionPointParent. */
export interface UpdateActionPointParentArgs {
  action_point_id: string;
  new_parent_id: string;
}

/** Arguments of UpdateActionPointPosition. */
export interface UpdateActionPointPositionArgs {
  action_point_id: string;
  new_position: Position;
}

/** Arguments of UpdateActionPointUsingRobot. */
export interface UpdateActionPointUsingRobotArgs {
  action_point_id: string;
  robot: RobotArg;
}

/** Arguments of UpdateFunctionParameter; `value` replaces the parameter in the present calls of the function. */
export interface UpdateFunctionParameterArgs {
  function_id: string;
  name: string;
  new_name?: string;
  type?: string;
  value?: Parameter;
}

/** Arguments of UpdateFunctionResult; `index` counts from 0. */
export interface UpdateFunctionResultArgs {
  function_id: string;
  index: number;
  link: string;
}

/** Arguments of UpdateLock. */
export interface UpdateLockArgs {
  object_id: string;
  new_type: LockType;
}

/**
 * Arguments of UpdateLogicItem; omitted `error_kinds` or `when` are unchanged, empty ones are removed.
 *
 * A `condition` removes `when`.
 */
export interface UpdateLogicItemArgs {
  logic_item_id: string;
  start: string;
  end: string;
  condition?: ProjectLogicIf;
  error_kinds?: string[];
  when?: LogicWhen;
}

/** Arguments of UpdateObjectModel. */
export interface UpdateObjectModelArgs {
  object_type_id: string;
  object_model: ObjectModel;
}

/** Arguments of UpdateObjectParameters. */
export interface UpdateObjectParametersArgs {
  id: string;
  parameters?: Parameter[];
}

/** Arguments of UpdateObjectPose. */
export interface UpdateObjectPoseArgs {
  object_id: string;
  pose: Pose;
}

/** Arguments of UpdateObjectPoseUsingRobot. */
export interface UpdateObjectPoseUsingRobotArgs {
  id: string;
  robot: RobotArg;
  pivot?: Pivot;
}

/** Arguments of UpdateOverride. */
export interface UpdateOverrideArgs {
  id: string;
  override: Parameter;
}

/** Arguments of UpdateParallel: the calls that a parallel action runs at once, in their order. */
export interface UpdateParallelArgs {
  action_id: string;
  branches: string[];
}

/** Arguments of UpdateProjectDescription. */
export interface UpdateProjectDescriptionArgs {
  project_id: string;
  new_description: string;
}

/** Arguments of UpdateProjectHasLogic. */
export interface UpdateProjectHasLogicArgs {
  project_id: string;
  new_has_logic: boolean;
}

/** Arguments of UpdateProjectParameter. */
export interface UpdateProjectParameterArgs {
  id: string;
  name?: string;
  value?: string;
}

/** Arguments of UpdateSceneDescription. */
export interface UpdateSceneDescriptionArgs {
  scene_id: string;
  new_description: string;
}

/** Arguments of UploadPackage. */
export interface UploadPackageArgs {
  id: string;
  data: string;
}

/** A calibration that was in force: its record, object, kind and date. */
export interface UsedCalibration {
  id: string;
  object_id: string;
  object_name: string;
  kind: string;
  date: string;
}

/**
 * The recipe with which a program runs, or ran.
 *
 * values: all values of the recipe, JSON in a string, as used in this run. planned_rate: planned parts per hour.
 */
export interface UsedRecipe {
  id: string;
  product: string;
  revision: number;
  state: RecipeState;
  package_hash: string;
  values: Record<string, string>;
  planned_rate?: number;
}

/** Data of the event UserPresence; `presence` is omitted before the first report of the client. */
export interface UserPresenceData {
  user: string;
  online: boolean;
  role: string;
  presence?: Presence;
}

/** The present value of a variable of the project, JSON in a string. */
export interface VariableValue {
  id: string;
  name: string;
  value: string;
}

/** Scope of a part of the view state. */
export type ViewScope = "user" | "shared";

/**
 * The view state of a document, or a change of it, in which null is a removed value.
 *
 * document: id of a scene, project or package; empty: none. user: the user, with scope user. revision: grows with
 * every change, so that answers and events can be ordered.
 */
export interface ViewState {
  scope: ViewScope;
  values: Record<string, unknown>;
  revision: number;
  document: string;
  user?: string;
}

/** A time in which no device executed an action; `before` is the name of the action after it. */
export interface Wait {
  before: string;
  start: number;
  duration: number;
}

/** Arguments of WriteLock. */
export interface WriteLockArgs {
  object_id: string;
  lock_tree?: boolean;
}

/** Arguments of WriteUnlock. */
export interface WriteUnlockArgs {
  object_id: string;
}

/** Arguments and response data of each request. */
export interface Requests {
  AcknowledgeAlarm: { args: AcknowledgeAlarmArgs; data: undefined };
  AcknowledgeStop: { args: AcknowledgeStopArgs; data: undefined };
  ActionParamValues: { args: ActionParamValuesArgs; data: string[] };
  AddAction: { args: AddActionArgs; data: undefined };
  AddActionPoint: { args: AddActionPointArgs; data: undefined };
  AddActionPointJointsUsingRobot: { args: AddActionPointJointsUsingRobotArgs; data: undefined };
  AddActionPointOrientation: { args: AddActionPointOrientationArgs; data: undefined };
  AddActionPointOrientationUsingRobot: { args: AddActionPointOrientationUsingRobotArgs; data: undefined };
  AddApUsingRobot: { args: AddApUsingRobotArgs; data: undefined };
  AddFunction: { args: AddFunctionArgs; data: AddFunctionData };
  AddFunctionParameter: { args: AddFunctionParameterArgs; data: undefined };
  AddFunctionResult: { args: AddFunctionResultArgs; data: undefined };
  AddLogicItem: { args: AddLogicItemArgs; data: undefined };
  AddObjectToScene: { args: AddObjectToSceneArgs; data: undefined };
  AddOverride: { args: AddOverrideArgs; data: undefined };
  AddPerson: { args: AddPersonArgs; data: Person };
  AddProjectParameter: { args: AddProjectParameterArgs; data: undefined };
  AddSceneObject: { args: AddObjectToSceneArgs; data: undefined };
  AddSceneShape: { args: AddVirtualCollisionObjectToSceneArgs; data: undefined };
  AddVirtualCollisionObjectToScene: { args: AddVirtualCollisionObjectToSceneArgs; data: undefined };
  AlarmStatistics: { args: AlarmStatisticsArgs | undefined; data: AlarmStatisticsData };
  Authenticate: { args: AuthenticateArgs; data: AuthenticateData };
  BackUpParameters: { args: DeviceArgs; data: BackupInfo };
  BuildProject: { args: BuildProjectArgs; data: BuildProjectData };
  CalibrateCamera: { args: CalibrateCameraArgs; data: undefined };
  CalibrateRobot: { args: CalibrateRobotArgs; data: undefined };
  CameraColorImage: { args: CameraColorImageArgs; data: string };
  CameraColorParameters: { args: CameraColorParametersArgs; data: CameraParameters };
  CancelAction: { args: undefined; data: undefined };
  CancelDryRun: { args: undefined; data: undefined };
  ChangeOver: { args: IdArgs; data: Changeover };
  ChangeOwnPin: { args: ChangeOwnPinArgs; data: undefined };
  ChangePerson: { args: ChangePersonArgs; data: Person };
  CheckCalibration: { args: CheckCalibrationArgs; data: CalibrationCheck };
  CheckConnection: { args: CheckConnectionArgs; data: CheckConnectionData };
  CheckScript: { args: ScriptArgs; data: CheckScriptData };
  CloseProject: { args: CloseProjectArgs | undefined; data: undefined };
  CloseScene: { args: CloseSceneArgs | undefined; data: undefined };
  CompareParameters: { args: BackupArgs; data: CompareParametersData };
  CompareRecipes: { args: CompareRecipesArgs; data: RecipeComparison };
  ConfirmDevice: { args: ConfirmDeviceArgs; data: DeviceCard };
  ConfirmParts: { args: ConfirmPartsArgs; data: undefined };
  CopyActionPoint: { args: CopyActionPointArgs; data: undefined };
  CopyProject: { args: CopyProjectArgs; data: undefined };
  CopyScene: { args: CopySceneArgs; data: string };
  CreateAdministrator: { args: CreateAdministratorArgs; data: Person };
  DecideHeld: { args: DecideHeldArgs; data: undefined };
  DeleteInterlock: { args: IdArgs; data: undefined };
  DeleteObjectTypes: { args: string[] | undefined; data: DeleteObjectTypesData[] };
  DeleteOverride: { args: DeleteOverrideArgs; data: undefined };
  DeletePackage: { args: IdArgs; data: undefined };
  DeleteParameterBackup: { args: BackupArgs; data: undefined };
  DeleteProject: { args: IdArgs; data: undefined };
  DeleteRecipe: { args: IdArgs; data: undefined };
  DeleteScene: { args: IdArgs; data: string[] };
  DissolveCall: { args: DissolveCallArgs; data: DissolveCallData };
  DissolveParallel: { args: DissolveParallelArgs; data: undefined };
  EndForce: { args: EndForceArgs; data: undefined };
  ExecuteAction: { args: ExecuteActionArgs; data: undefined };
  ExportFunction: { args: IdArgs; data: FunctionExport };
  FindDevices: { args: FindDevicesArgs; data: FoundDevice[] };
  ForcePoint: { args: ForcePointArgs; data: ForcePointData };
  ForwardKinematics: { args: ForwardKinematicsArgs; data: Pose };
  GetActions: { args: TypeArgs; data: ObjectAction[] };
  GetBreakpoints: { args: GetBreakpointsArgs | undefined; data: ProjectBreakpoints };
  GetCameraPose: { args: GetCameraPoseArgs; data: EstimatedPose };
  GetCell: { args: undefined; data: CellStatus };
  GetDryRun: { args: GetDryRunArgs | undefined; data: GetDryRunData };
  GetEndEffectorPose: { args: GetEndEffectorPoseArgs; data: Pose };
  GetEndEffectors: { args: GetEndEffectorsArgs; data: string[] };
  GetExecutionTrace: { args: GetExecutionTraceArgs | undefined; data: GetExecutionTraceData };
  GetGrippers: { args: GetGrippersArgs; data: string[] };
  GetHeld: { args: undefined; data: GetHeldData };
  GetObjectTypes: { args: undefined; data: ObjectTypeMeta[] };
  GetPackageParameters: { args: IdArgs; data: PackageParametersData };
  GetParameterBackup: { args: BackupArgs; data: ParameterBackup };
  GetParts: { args: undefined; data: PartInventory[] };
  GetProduction: { args: GetProductionArgs | undefined; data: Production };
  GetProgramPosition: { args: undefined; data: ProgramPosition };
  GetProject: { args: IdArgs; data: Project };
  GetRobotArms: { args: GetRobotArmsArgs; data: string[] };
  GetRobotJoints: { args: GetRobotJointsArgs; data: Joint[] };
  GetRobotMeta: { args: undefined; data: RobotMeta[] };
  GetScene: { args: IdArgs; data: Scene };
  GetSuctions: { args: GetSuctionsArgs; data: string[] };
  GetUnit: { args: GetUnitArgs; data: UnitRecord };
  GetViewState: { args: GetViewStateArgs; data: ViewState };
  HandTeachingMode: { args: HandTeachingModeArgs; data: undefined };
  History: { args: HistoryArgs | undefined; data: HistoryData };
  HoldHandTeaching: { args: HoldHandTeachingArgs; data: undefined };
  ImportFunction: { args: ImportFunctionArgs; data: ImportFunctionData };
  ImportScript: { args: ScriptArgs; data: ImportScriptData };
  InverseKinematics: { args: InverseKinematicsArgs; data: Joint[] };
  JogRobot: { args: JogRobotArgs; data: JogRobotData };
  KeepLoggedOn: { args: undefined; data: undefined };
  ListAlarms: { args: ListAlarmsArgs | undefined; data: ListAlarmsData };
  ListCalibrations: { args: ListCalibrationsArgs | undefined; data: ListCalibrationsData };
  ListDeviceCards: { args: undefined; data: ListDeviceCardsData };
  ListInterlocks: { args: undefined; data: ListInterlocksData };
  ListLocks: { args: undefined; data: LockHolder[] };
  ListNodes: { args: undefined; data: NodesData };
  ListPackages: { args: undefined; data: PackageSummary[] };
  ListPersons: { args: undefined; data: ListPersonsData };
  ListProjects: { args: undefined; data: ListProjectsData[] };
  ListRecipes: { args: ListRecipesArgs | undefined; data: ListRecipesData };
  ListRuns: { args: ListRunsArgs | undefined; data: ListRunsData };
  ListScenes: { args: undefined; data: ListScenesData[] };
  ListUnits: { args: ListUnitsArgs | undefined; data: ListUnitsData };
  LogOff: { args: undefined; data: undefined };
  LogOn: { args: LogOnArgs; data: LogOnData };
  MakeFunction: { args: MakeFunctionArgs; data: MakeFunctionData };
  MakeParallel: { args: MakeParallelArgs; data: MakeParallelData };
  MarkersCorners: { args: MarkersCornersArgs; data: MarkerCorners[] };
  MoveToActionPoint: { args: MoveToActionPointArgs; data: undefined };
  MoveToJoints: { args: MoveToJointsArgs; data: undefined };
  MoveToPose: { args: MoveToPoseArgs; data: undefined };
  NewObjectType: { args: ObjectTypeMeta; data: undefined };
  NewProject: { args: NewProjectArgs; data: undefined };
  NewScene: { args: NewSceneArgs; data: undefined };
  ObjectAimingAddPoint: { args: ObjectAimingAddPointArgs; data: ObjectAimingAddPointData };
  ObjectAimingCancel: { args: undefined; data: undefined };
  ObjectAimingDone: { args: undefined; data: ObjectAimingAddPointData };
  ObjectAimingStart: { args: ObjectAimingStartArgs; data: undefined };
  ObjectTypeUsage: { args: IdArgs; data: string[] };
  OpenProject: { args: IdArgs; data: undefined };
  OpenScene: { args: IdArgs; data: undefined };
  PausePackage: { args: undefined; data: undefined };
  PreviewMove: { args: MovePreview; data: undefined };
  ProjectScript: { args: undefined; data: ProjectScriptData };
  ProjectsWithScene: { args: IdArgs; data: string[] };
  PutInterlock: { args: PutInterlockArgs; data: PutInterlockData };
  PutParameterBackup: { args: PutParameterBackupArgs; data: BackupInfo };
  PutRecipe: { args: PutRecipeArgs; data: Recipe };
  Reachability: { args: ReachabilityArgs | undefined; data: ReachabilityData[] };
  ReadLock: { args: ReadLockArgs; data: undefined };
  ReadUnlock: { args: ReadUnlockArgs; data: undefined };
  Redo: { args: RedoArgs | undefined; data: UndoData };
  RegisterForRobotEvent: { args: RegisterForRobotEventArgs; data: string[] };
  RegisterUser: { args: RegisterUserArgs; data: undefined };
  RemoveAction: { args: RemoveActionArgs; data: undefined };
  RemoveActionPoint: { args: IdArgs; data: undefined };
  RemoveActionPointJoints: { args: RemoveActionPointJointsArgs; data: undefined };
  RemoveActionPointOrientation: { args: RemoveActionPointOrientationArgs; data: undefined };
  RemoveFromScene: { args: RemoveFromSceneArgs; data: undefined };
  RemoveFunction: { args: IdArgs; data: undefined };
  RemoveFunctionParameter: { args: RemoveFunctionParameterArgs; data: undefined };
  RemoveFunctionResult: { args: RemoveFunctionResultArgs; data: undefined };
  RemoveLogicItem: { args: RemoveLogicItemArgs; data: undefined };
  RemovePerson: { args: RemovePersonArgs; data: undefined };
  RemoveProjectParameter: { args: RemoveProjectParameterArgs; data: undefined };
  RenameAction: { args: RenameActionArgs; data: undefined };
  RenameActionPoint: { args: RenameActionPointArgs; data: undefined };
  RenameActionPointJoints: { args: RenameActionPointJointsArgs; data: undefined };
  RenameActionPointOrientation: { args: RenameActionPointOrientationArgs; data: undefined };
  RenameFunction: { args: RenameFunctionArgs; data: undefined };
  RenameObject: { args: RenameArgs; data: undefined };
  RenamePackage: { args: RenamePackageArgs; data: undefined };
  RenameProject: { args: RenameProjectArgs; data: undefined };
  RenameScene: { args: RenameArgs; data: undefined };
  RenewForces: { args: RenewForcesArgs; data: undefined };
  RestoreParameters: { args: BackupArgs; data: RestoreParametersData };
  RestoreRevision: { args: RestoreRevisionArgs; data: RestoreRevisionData };
  ResumePackage: { args: undefined; data: undefined };
  RetryObject: { args: RetryObjectArgs; data: undefined };
  RunPackage: { args: RunPackageArgs; data: undefined };
  SaveProject: { args: undefined; data: undefined };
  SaveScene: { args: undefined; data: undefined };
  SceneObjectUsage: { args: IdArgs; data: string[] };
  SetBreakpoints: { args: SetBreakpointsArgs; data: ProjectBreakpoints };
  SetCellAuthority: { args: SetCellAuthorityArgs; data: CellStatus };
  SetCellJobs: { args: SetCellJobsArgs; data: CellStatus };
  SetCellMode: { args: SetCellModeArgs; data: CellStatus };
  SetEefPerpendicularToWorld: { args: SetEefPerpendicularToWorldArgs; data: undefined };
  SetObjectNode: { args: SetObjectNodeArgs; data: undefined };
  SetViewState: { args: SetViewStateArgs; data: SetViewStateData };
  ShelveAlarm: { args: ShelveAlarmArgs; data: undefined };
  SignRecipe: { args: SignRecipeArgs; data: Recipe };
  StartDryRun: { args: StartDryRunArgs | undefined; data: DryRunHead };
  StartScene: { args: undefined; data: undefined };
  StartSceneKeepGoing: { args: undefined; data: undefined };
  StepAction: { args: StepActionArgs | undefined; data: undefined };
  StepRobotEef: { args: StepRobotEefArgs; data: undefined };
  StopAll: { args: undefined; data: StopAllData };
  StopPackage: { args: undefined; data: undefined };
  StopRobot: { args: StopRobotArgs; data: undefined };
  StopScene: { args: undefined; data: undefined };
  StreamObservations: { args: StreamObservationsArgs; data: undefined };
  StreamPoints: { args: StreamPointsArgs; data: undefined };
  StreamRobot: { args: StreamRobotArgs; data: undefined };
  SubscribeEvents: { args: SubscribeEventsArgs; data: undefined };
  SystemInfo: { args: undefined; data: SystemInfoData };
  TakeOverLocks: { args: TakeOverLocksArgs; data: TakeOverLocksData };
  TemporaryPackage: { args: TemporaryPackageArgs | undefined; data: undefined };
  Undo: { args: UndoArgs | undefined; data: UndoData };
  UpdateAction: { args: UpdateActionArgs; data: undefined };
  UpdateActionPointJoints: { args: UpdateActionPointJointsArgs; data: undefined };
  UpdateActionPointJointsUsingRobot: { args: UpdateActionPointJointsUsingRobotArgs; data: undefined };
  UpdateActionPointOrientation: { args: UpdateActionPointOrientationArgs; data: undefined };
  UpdateActionPointOrientationUsingRobot: { args: UpdateActionPointOrientationUsingRobotArgs; data: undefined };
  UpdateActionPointParent: { args: UpdateActionPointParentArgs; data: undefined };
  UpdateActionPointPosition: { args: UpdateActionPointPositionArgs; data: undefined };
  UpdateActionPointUsingRobot: { args: UpdateActionPointUsingRobotArgs; data: undefined };
  UpdateFunctionParameter: { args: UpdateFunctionParameterArgs; data: undefined };
  UpdateFunctionResult: { args: UpdateFunctionResultArgs; data: undefined };
  UpdateLock: { args: UpdateLockArgs; data: undefined };
  UpdateLogicItem: { args: UpdateLogicItemArgs; data: undefined };
  UpdateObjectModel: { args: UpdateObjectModelArgs; data: undefined };
  UpdateObjectParameters: { args: UpdateObjectParametersArgs; data: undefined };
  UpdateObjectPose: { args: UpdateObjectPoseArgs; data: undefined };
  UpdateObjectPoseUsingRobot: { args: UpdateObjectPoseUsingRobotArgs; data: undefined };
  UpdateOverride: { args: UpdateOverrideArgs; data: undefined };
  UpdateParallel: { args: UpdateParallelArgs; data: undefined };
  UpdatePresence: { args: Presence; data: undefined };
  UpdateProjectDescription: { args: UpdateProjectDescriptionArgs; data: undefined };
  UpdateProjectHasLogic: { args: UpdateProjectHasLogicArgs; data: undefined };
  UpdateProjectParameter: { args: UpdateProjectParameterArgs; data: undefined };
  UpdateSceneDescription: { args: UpdateSceneDescriptionArgs; data: undefined };
  UpdateSceneObjectPose: { args: UpdateObjectPoseArgs; data: undefined };
  UpdateSceneObjectSettings: { args: UpdateObjectParametersArgs; data: undefined };
  UpdateSceneShape: { args: UpdateObjectModelArgs; data: undefined };
  UploadPackage: { args: UploadPackageArgs; data: undefined };
  WriteLock: { args: WriteLockArgs; data: undefined };
  WriteUnlock: { args: WriteUnlockArgs; data: undefined };
}

/** Data of each event. */
export interface Events {
  ActionCancelled: undefined;
  ActionChanged: BareAction;
  ActionExecution: ActionExecutionData;
  ActionPointChanged: BareActionPoint;
  ActionResult: ActionResultData;
  ActionStateAfter: ActionStateAfterData;
  ActionStateBefore: ActionStateBeforeData;
  AlarmChanged: AlarmRecord;
  BreakpointsChanged: ProjectBreakpoints;
  CellChanged: CellStatus;
  ChangedObjectTypes: ObjectTypeMeta[];
  ChangeoverChanged: Changeover;
  DeviceCardChanged: DeviceCard;
  DryRunChanged: DryRunHead;
  ExecutionTrace: TraceEntry;
  ForcesChanged: ForcesChangedData;
  FunctionChanged: ProjectFunction;
  HandTeachingMode: HandTeachingModeData;
  Held: HeldData;
  HistoryChanged: HistoryChangedData;
  HoldDecided: HoldDecidedData;
  InterlockChanged: Interlock;
  InterlockStates: InterlockStates;
  JointsChanged: ProjectRobotJoints;
  LogOnChanged: LogOnChangedData;
  LogicItemChanged: LogicItem;
  MovePreview: MovePreviewData;
  NodesChanged: NodesData;
  Notification: NotificationData;
  ObjectHealth: ObjectHealthData;
  ObjectObservations: ObjectObservationsData;
  ObjectPoints: ObjectPointsData;
  ObjectState: ObjectStateData;
  ObjectValues: ObjectValuesData;
  ObjectsLocked: LockData;
  ObjectsUnlocked: LockData;
  OpenProject: OpenProjectData;
  OpenScene: OpenSceneData;
  OrientationChanged: NamedOrientation;
  OverrideUpdated: Parameter;
  PackageChanged: PackageSummary;
  PackageInfo: PackageInfoData;
  PackageState: PackageStateData;
  PartsChanged: PartInventory;
  PersonChanged: Person;
  ProcessState: ProcessStateData;
  ProgramPosition: ProgramPosition;
  ProjectChanged: BareProject;
  ProjectClosed: undefined;
  ProjectException: ProjectExceptionData;
  ProjectParameterChanged: ProjectParameter;
  ProjectSaved: undefined;
  ReachabilityChanged: ReachabilityData;
  RecipeChanged: Recipe;
  RecordingChanged: RecordingChangedData;
  RobotEef: RobotEefData;
  RobotHold: RobotHoldData;
  RobotJoints: RobotJointsData;
  RobotMoveToActionPointJoints: RobotMoveToActionPointJointsData;
  RobotMoveToActionPointOrientation: RobotMoveToActionPointOrientationData;
  RobotMoveToJoints: RobotMoveToJointsData;
  RobotMoveToPose: RobotMoveToPoseData;
  RunChanged: Run;
  RunStatistics: RunStatisticsData;
  SceneChanged: BareScene;
  SceneClosed: undefined;
  SceneObjectChanged: SceneObject;
  SceneSaved: undefined;
  SceneState: SceneStateData;
  ShowMainScreen: ShowMainScreenData;
  TaskState: TaskStateData;
  UnitChanged: Unit;
  UserPresence: UserPresenceData;
  ViewStateChanged: ViewState;
}

/** An event as the server sends it. */
export type ServerEvent = {
  [Name in keyof Events]: {
    event: Name;
    data: Events[Name];
    change_type?: ChangeType;
    parent_id?: string;
  };
}[keyof Events];

/** Roles. Each includes the permissions of the lower ones. */
export const ROLES = {
  operator: 1,
  standard_user: 2,
  advanced_user: 3,
  technician: 4,
  programmer: 5,
} as const;

/** Lowest role that may send each request. */
export const MIN_ROLE: Record<keyof Requests, number> = {
  AcknowledgeAlarm: 1,
  AcknowledgeStop: 1,
  ActionParamValues: 2,
  AddAction: 2,
  AddActionPoint: 2,
  AddActionPointJointsUsingRobot: 2,
  AddActionPointOrientation: 2,
  AddActionPointOrientationUsingRobot: 2,
  AddApUsingRobot: 2,
  AddFunction: 2,
  AddFunctionParameter: 2,
  AddFunctionResult: 2,
  AddLogicItem: 2,
  AddObjectToScene: 4,
  AddOverride: 3,
  AddPerson: 5,
  AddProjectParameter: 3,
  AddSceneObject: 4,
  AddSceneShape: 4,
  AddVirtualCollisionObjectToScene: 4,
  AlarmStatistics: 1,
  Authenticate: 1,
  BackUpParameters: 4,
  BuildProject: 2,
  CalibrateCamera: 4,
  CalibrateRobot: 4,
  CameraColorImage: 1,
  CameraColorParameters: 1,
  CancelAction: 1,
  CancelDryRun: 2,
  ChangeOver: 1,
  ChangeOwnPin: 1,
  ChangePerson: 5,
  CheckCalibration: 1,
  CheckConnection: 4,
  CheckScript: 2,
  CloseProject: 2,
  CloseScene: 2,
  CompareParameters: 4,
  CompareRecipes: 1,
  ConfirmDevice: 4,
  ConfirmParts: 1,
  CopyActionPoint: 2,
  CopyProject: 2,
  CopyScene: 4,
  CreateAdministrator: 1,
  DecideHeld: 1,
  DeleteInterlock: 4,
  DeleteObjectTypes: 5,
  DeleteOverride: 3,
  DeletePackage: 3,
  DeleteParameterBackup: 4,
  DeleteProject: 2,
  DeleteRecipe: 3,
  DeleteScene: 4,
  DissolveCall: 2,
  DissolveParallel: 2,
  EndForce: 1,
  ExecuteAction: 2,
  ExportFunction: 1,
  FindDevices: 4,
  ForcePoint: 4,
  ForwardKinematics: 2,
  GetActions: 1,
  GetBreakpoints: 1,
  GetCameraPose: 4,
  GetCell: 1,
  GetDryRun: 1,
  GetEndEffectorPose: 1,
  GetEndEffectors: 1,
  GetExecutionTrace: 1,
  GetGrippers: 1,
  GetHeld: 1,
  GetObjectTypes: 1,
  GetPackageParameters: 1,
  GetParameterBackup: 4,
  GetParts: 1,
  GetProduction: 1,
  GetProgramPosition: 1,
  GetProject: 1,
  GetRobotArms: 1,
  GetRobotJoints: 1,
  GetRobotMeta: 1,
  GetScene: 1,
  GetSuctions: 1,
  GetUnit: 1,
  GetViewState: 1,
  HandTeachingMode: 2,
  History: 1,
  HoldHandTeaching: 2,
  ImportFunction: 2,
  ImportScript: 2,
  InverseKinematics: 2,
  JogRobot: 2,
  KeepLoggedOn: 1,
  ListAlarms: 1,
  ListCalibrations: 1,
  ListDeviceCards: 1,
  ListInterlocks: 1,
  ListLocks: 1,
  ListNodes: 1,
  ListPackages: 1,
  ListPersons: 1,
  ListProjects: 1,
  ListRecipes: 1,
  ListRuns: 1,
  ListScenes: 1,
  ListUnits: 1,
  LogOff: 1,
  LogOn: 1,
  MakeFunction: 2,
  MakeParallel: 2,
  MarkersCorners: 4,
  MoveToActionPoint: 2,
  MoveToJoints: 2,
  MoveToPose: 2,
  NewObjectType: 5,
  NewProject: 2,
  NewScene: 4,
  ObjectAimingAddPoint: 4,
  ObjectAimingCancel: 4,
  ObjectAimingDone: 4,
  ObjectAimingStart: 4,
  ObjectTypeUsage: 1,
  OpenProject: 2,
  OpenScene: 2,
  PausePackage: 1,
  PreviewMove: 2,
  ProjectScript: 1,
  ProjectsWithScene: 1,
  PutInterlock: 4,
  PutParameterBackup: 4,
  PutRecipe: 3,
  Reachability: 1,
  ReadLock: 1,
  ReadUnlock: 1,
  Redo: 2,
  RegisterForRobotEvent: 1,
  RegisterUser: 1,
  RemoveAction: 2,
  RemoveActionPoint: 2,
  RemoveActionPointJoints: 2,
  RemoveActionPointOrientation: 2,
  RemoveFromScene: 4,
  RemoveFunction: 2,
  RemoveFunctionParameter: 2,
  RemoveFunctionResult: 2,
  RemoveLogicItem: 2,
  RemovePerson: 5,
  RemoveProjectParameter: 3,
  RenameAction: 2,
  RenameActionPoint: 2,
  RenameActionPointJoints: 2,
  RenameActionPointOrientation: 2,
  RenameFunction: 2,
  RenameObject: 4,
  RenamePackage: 3,
  RenameProject: 2,
  RenameScene: 4,
  RenewForces: 4,
  RestoreParameters: 4,
  RestoreRevision: 2,
  ResumePackage: 1,
  RetryObject: 2,
  RunPackage: 1,
  SaveProject: 2,
  SaveScene: 4,
  SceneObjectUsage: 1,
  SetBreakpoints: 2,
  SetCellAuthority: 4,
  SetCellJobs: 4,
  SetCellMode: 4,
  SetEefPerpendicularToWorld: 2,
  SetObjectNode: 4,
  SetViewState: 1,
  ShelveAlarm: 4,
  SignRecipe: 3,
  StartDryRun: 2,
  StartScene: 2,
  StartSceneKeepGoing: 2,
  StepAction: 1,
  StepRobotEef: 2,
  StopAll: 1,
  StopPackage: 1,
  StopRobot: 1,
  StopScene: 2,
  StreamObservations: 1,
  StreamPoints: 1,
  StreamRobot: 1,
  SubscribeEvents: 1,
  SystemInfo: 1,
  TakeOverLocks: 2,
  TemporaryPackage: 2,
  Undo: 2,
  UpdateAction: 2,
  UpdateActionPointJoints: 2,
  UpdateActionPointJointsUsingRobot: 2,
  UpdateActionPointOrientation: 2,
  UpdateActionPointOrientationUsingRobot: 2,
  UpdateActionPointParent: 2,
  UpdateActionPointPosition: 2,
  UpdateActionPointUsingRobot: 2,
  UpdateFunctionParameter: 2,
  UpdateFunctionResult: 2,
  UpdateLock: 2,
  UpdateLogicItem: 2,
  UpdateObjectModel: 4,
  UpdateObjectParameters: 4,
  UpdateObjectPose: 4,
  UpdateObjectPoseUsingRobot: 4,
  UpdateOverride: 3,
  UpdateParallel: 2,
  UpdatePresence: 1,
  UpdateProjectDescription: 2,
  UpdateProjectHasLogic: 3,
  UpdateProjectParameter: 2,
  UpdateSceneDescription: 4,
  UpdateSceneObjectPose: 4,
  UpdateSceneObjectSettings: 4,
  UpdateSceneShape: 4,
  UploadPackage: 5,
  WriteLock: 2,
  WriteUnlock: 2,
};

/** Additional events, sent only to clients that subscribed to them. */
export const ADDITIONAL_EVENTS = [
  "AlarmChanged",
  "BreakpointsChanged",
  "CellChanged",
  "ChangeoverChanged",
  "DeviceCardChanged",
  "DryRunChanged",
  "ExecutionTrace",
  "ForcesChanged",
  "FunctionChanged",
  "Held",
  "HistoryChanged",
  "HoldDecided",
  "InterlockChanged",
  "InterlockStates",
  "LogOnChanged",
  "MovePreview",
  "NodesChanged",
  "ObjectHealth",
  "ObjectObservations",
  "ObjectPoints",
  "ObjectState",
  "ObjectValues",
  "PartsChanged",
  "PersonChanged",
  "ProgramPosition",
  "ReachabilityChanged",
  "RecipeChanged",
  "RecordingChanged",
  "RobotHold",
  "RunChanged",
  "RunStatistics",
  "TaskState",
  "UnitChanged",
  "UserPresence",
  "ViewStateChanged",
] as const satisfies (keyof Events)[];
