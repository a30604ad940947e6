/**
 * The protocol's data, requests and events. Made by editor/protocol_types.py from arcor2_hw.data: do not edit.
 *
 * A field with `?` may be left out. Lengths are in m, angles in rad, quaternions x, y, z, w.
 */

/** Arguments of AcknowledgeStop: the stop or fault of a robot; with `code`, an alarm of any device. */
export interface AcknowledgeStopArgs {
  object_id: string;
  code?: string;
}

/** An action on an action point. */
export interface Action {
  name: string;
  type: string;
  id: string;
  parameters: ActionParameter[];
  flows: Flow[];
}

/** What the event ActionExecution carries. */
export interface ActionExecutionData {
  action_id: string;
}

/** How an action is treated. `composite` actions may call others; `hidden` ones are not offered. */
export interface ActionMetadata {
  composite: boolean;
  hidden: boolean;
  cancellable: boolean;
}

/** An action that a run was in; `name` is empty where the project does not know it. */
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

/** A literal, a project parameter or a link to a result, told apart by `type`. */
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

/** What the event ActionResult carries. */
export interface ActionResultData {
  action_id: string;
  results?: string[];
  error?: string;
}

/** What the event ActionStateAfter carries. */
export interface ActionStateAfterData {
  action_id: string;
  results?: string[];
}

/** What the event ActionStateBefore carries. */
export interface ActionStateBeforeData {
  action_id?: string;
  parameters?: string[];
  action_point_ids?: string[];
  thread_id?: number;
}

/** Arguments of AddAction. */
export interface AddActionArgs {
  action_point_id: string;
  name: string;
  type: string;
  parameters?: ActionParameter[];
  flows?: Flow[];
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

/** Arguments of AddLogicItem. */
export interface AddLogicItemArgs {
  start: string;
  end: string;
  condition?: ProjectLogicIf;
}

/** Arguments of AddObjectToScene. */
export interface AddObjectToSceneArgs {
  name: string;
  type: string;
  pose?: Pose;
  parameters?: Parameter[];
}

/** Arguments of AddOverride. */
export interface AddOverrideArgs {
  id: string;
  override: Parameter;
}

/** Arguments of AddProjectParameter. */
export interface AddProjectParameterArgs {
  name: string;
  type: string;
  value: string;
}

/** Arguments of AddVirtualCollisionObjectToScene. */
export interface AddVirtualCollisionObjectToSceneArgs {
  name: string;
  pose: Pose;
  model: ObjectModel;
}

/** Something a person should deal with; `remedy` says how. */
export interface Alarm {
  code: string;
  severity: Severity;
  text: string;
  remedy: string;
  since: string;
}

/** Arguments of Authenticate. */
export interface AuthenticateArgs {
  token: string;
}

/** What Authenticate answers: whose token it is, and the role that it gives. */
export interface AuthenticateData {
  name: string;
  role: string;
}

/** An action without parameters and flows; `type` is `<object id>/<action name>`. */
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

/** Arguments of BuildProject. */
export interface BuildProjectArgs {
  project_id: string;
  package_name: string;
}

/** What BuildProject answers. */
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

/** A later measurement compared with a record: distance (m), angle (rad), and whether both are within limits. */
export interface CalibrationCheck {
  record_id: string;
  date: string;
  distance: number;
  angle: number;
  distance_limit: number;
  angle_limit: number;
  passed: boolean;
  verdict: string;
}

/** Something a calibration was computed from: sha256 in hex and size in bytes; file: where it is kept, if it is. */
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
 * person: user name of whoever did it. object_id and object_name: of the scene object whose pose, lens or tool it is;
 * parent: name of the frame in which the poses are stated ("world", a robot's base or flange). inputs: pictures and
 * tables it was computed from; parameters: what else went in (joints, markers, options), as JSON values. residual: in
 * residual_unit ("m", "rad" or "px"); result: the whole result, as JSON values. before and after: pose of the object
 * until then and since, where the result is a pose; applied: whether the object was given it.
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

/** What happened to the item that an event carries. */
export type ChangeType = "add" | "update" | "remove" | "update_base";

/**
 * Arguments of CheckCalibration: a record, a pose in its frame, and how far that may be off (m, rad).
 *
 * pose: one that was measured, or a reference; left out, that of the object in the open scene.
 */
export interface CheckCalibrationArgs {
  id: string;
  pose?: Pose;
  distance_limit?: number;
  angle_limit?: number;
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

/** The life of a connection. */
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

/** A point in the image, pixels. */
export interface Corner {
  x: number;
  y: number;
}

/** A cylinder around its origin along z, m. */
export interface Cylinder {
  id: string;
  radius: number;
  height: number;
}

/** What DeleteObjectTypes answers. */
export interface DeleteObjectTypesData {
  id: string;
  error: string;
}

/** Arguments of DeleteOverride. */
export interface DeleteOverrideArgs {
  id: string;
  override: Parameter;
}

/** Pose of one end effector in the world. */
export interface EefPose {
  end_effector_id: string;
  pose: Pose;
  arm_id?: string;
}

/** A pose with its quality, 0..1. */
export interface EstimatedPose {
  pose: Pose;
  quality: number;
}

/** Arguments of ExecuteAction. */
export interface ExecuteActionArgs {
  action_id: string;
}

/**
 * Names for the results of an action; empty outputs mean that results are not kept.
 *
 * Raises ValueError when an output name occurs twice.
 */
export interface Flow {
  type: FlowTypes;
  outputs: string[];
}

/** Kinds of flow that leave an action. */
export type FlowTypes = "default";

/** Arguments of ForwardKinematics. */
export interface ForwardKinematicsArgs {
  robot_id: string;
  end_effector_id: string;
  joints: Joint[];
  arm_id?: string;
}

/** A result of a project function. */
export interface FunctionReturns {
  type: string;
  link: string;
}

/** Arguments of GetBreakpoints: of which project, else of the open one. */
export interface GetBreakpointsArgs {
  project_id?: string;
}

/** Arguments of GetCameraPose. */
export interface GetCameraPoseArgs {
  camera_parameters: CameraParameters;
  image: string;
  inverse?: boolean;
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

/** Arguments of GetExecutionTrace: at most so many actions of the present or last run, the newest first. */
export interface GetExecutionTraceArgs {
  limit?: number;
  before?: number;
}

/** What GetExecutionTrace answers: the run (0: there was none), and its actions, newest first. */
export interface GetExecutionTraceData {
  run: number;
  entries: TraceEntry[];
}

/** Arguments of GetGrippers. */
export interface GetGrippersArgs {
  robot_id: string;
  arm_id?: string;
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

/** Arguments of GetViewState; `user`: whose, else the caller's. */
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

/** What the event HandTeachingMode carries. */
export interface HandTeachingModeData {
  robot_id: string;
  enabled: boolean;
  arm_id?: string;
}

/** Condition of a device (NAMUR NE 107). */
export type Health = "normal" | "check_function" | "off_spec" | "maintenance_required" | "failure";

/** One lock: what is locked, its name if it has one, and since when. `type` is left out for a read lock. */
export interface HeldLock {
  object_id: string;
  name: string;
  since: string;
  type?: LockType;
}

/** Arguments of History: at most so many edits, the newest ones before that number. */
export interface HistoryArgs {
  limit?: number;
  before?: number;
}

/** What the event HistoryChanged carries: of the user to whom it is sent. */
export interface HistoryChangedData {
  revision: number;
  undo?: HistoryStep;
  redo?: HistoryStep;
}

/**
 * What History answers: the revision there is, the oldest one that can be restored, and edits, newest first.
 *
 * `undo` and `redo` are the edits that these requests of the caller would take back.
 */
export interface HistoryData {
  revision: number;
  oldest: number;
  edits: HistoryEdit[];
  undo?: number;
  redo?: number;
}

/** One edit. `of` is what an undo or redo took back, or the revision that was restored. */
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

/** One thing that an edit touched; `name` is empty for what has none. */
export interface HistoryItem {
  kind: string;
  id: string;
  name: string;
  change: string;
}

/**
 * What Undo or Redo of a user would take back now.
 *
 * request: what made it. text: the sentence for the button, without `Undo` or `Redo` before it.
 */
export interface HistoryStep {
  number: number;
  request: string;
  text: string;
}

/** Arguments of HoldHandTeaching; `hold`, `sent_ms` and `valid_ms` as in JogRobot. */
export interface HoldHandTeachingArgs {
  robot_id: string;
  hold: number;
  sent_ms: number;
  valid_ms: number;
  arm_id?: string;
}

/** What lasts only as long as a person holds on to it. */
export type HoldKind = "jog" | "hand_teaching";

/** Arguments of every RPC that takes one id. */
export interface IdArgs {
  id: string;
}

/** A value by the id of what it belongs to. */
export interface IdValue {
  id: string;
  value: string;
}

/** Arguments of InverseKinematics. */
export interface InverseKinematicsArgs {
  robot_id: string;
  end_effector_id: string;
  pose: Pose;
  start_joints?: Joint[];
  avoid_collisions?: boolean;
  arm_id?: string;
}

/** The frame in whose axes a jog is given; the point that moves is always the end effector's. */
export type JogFrame = "world" | "robot" | "tool" | "user";

/**
 * Arguments of JogRobot: a velocity of the end effector (`linear` m/s, `angular` rad/s), or of joints (rad/s, m/s).
 *
 * hold: a number for this press of the button, larger than that of the one before; renewals carry the same.
 * sent_ms: when this was sent, by the sender's own steady clock; where it begins does not matter.
 * valid_ms: 1 to 300, for how long the velocity holds unless it is renewed; 0 lets go.
 * object_id, pose: for the frame `user`: an object of the scene, or a pose in the world.
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
}

/** What JogRobot answers: the fraction of the asked velocity that the robot was given, less than 1 where capped. */
export interface JogRobotData {
  scale: number;
}

/** A joint's value: rad, m where prismatic. */
export interface Joint {
  name: string;
  value: number;
}

/** Arguments of ListCalibrations: at most so many, the newest ones before a date, of an object, of a kind. */
export interface ListCalibrationsArgs {
  limit?: number;
  object_id?: string;
  kind?: CalibrationKind;
  before?: string;
}

/** What ListCalibrations answers: records, newest first. */
export interface ListCalibrationsData {
  records: CalibrationRecord[];
}

/** What ListProjects answers. */
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
}

/** Arguments of ListRuns: at most so many, the newest ones before that number, of a package or a project. */
export interface ListRunsArgs {
  limit?: number;
  before?: number;
  package_id?: string;
  project_id?: string;
}

/** What ListRuns answers: runs, newest first. */
export interface ListRunsData {
  runs: Run[];
}

/** What ListScenes answers. */
export interface ListScenesData {
  id: string;
  name: string;
  created: string;
  modified: string;
  description?: string;
  problems?: string[];
}

/** What ObjectsLocked and ObjectsUnlocked carry. */
export interface LockData {
  object_ids: string[];
  owner: string;
}

/** A user with locks. `left` is when the connection ended; left out while the user is connected. */
export interface LockHolder {
  user: string;
  locks: HeldLock[];
  left?: string;
}

/** Kinds of write lock. */
export type LockType = "TREE" | "OBJECT";

/** A step from one action to the next, taken when its condition holds. */
export interface LogicItem {
  start: string;
  end: string;
  condition?: ProjectLogicIf;
  id: string;
}

/** Values of WhatEnum in ShowMainScreen. */
export type MainScreen = "ScenesList" | "ProjectsList" | "PackagesList";

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

/** A mesh kept as an asset, with points by which a robot can be pointed at it. */
export interface Mesh {
  id: string;
  asset_id: string;
  focus_points?: Pose[];
}

/** Kinds of collision model. */
export type Model3dType = "None" | "Box" | "Cylinder" | "Sphere" | "Mesh";

/** Phases of a motion. */
export type MoveEventType = "start" | "end" | "failed";

/**
 * Where somebody drags an item just now, relative to its parent, as it would be stored.
 *
 * id: of an object, action point, orientation or joints. None of position, orientation, joints: it is over.
 */
export interface MovePreview {
  id: string;
  position?: Position;
  orientation?: Orientation;
  joints?: Joint[];
}

/** What the event MovePreview carries. */
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

/** What the event Notification carries. */
export interface NotificationData {
  message: string;
  level: NotificationLevel;
}

/** Values of Level in Notification. */
export type NotificationLevel = "Info" | "Warn" | "Error";

/**
 * One action of an object type; category, icon and former_names are ours, beside the protocol.
 *
 * former_names: names under which older projects call it.
 */
export interface ObjectAction {
  name: string;
  description?: string;
  parameters: ParameterMeta[];
  meta: ActionMetadata;
  origins?: string;
  returns: string[];
  disabled: boolean;
  problem?: string;
  category?: string;
  icon?: string;
  former_names?: string[];
}

/** Arguments of ObjectAimingAddPoint. */
export interface ObjectAimingAddPointArgs {
  point_idx: number;
}

/** What ObjectAimingAddPoint answers. */
export interface ObjectAimingAddPointData {
  finished_indexes: number[];
}

/** Arguments of ObjectAimingStart. */
export interface ObjectAimingStartArgs {
  object_id: string;
  robot: RobotArg;
}

/**
 * What the event ObjectHealth carries: condition, alarms and owner of control of an object in operation.
 *
 * control_owner: "us", another's name, or left out when nobody has control.
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
 * What the event ObjectState carries: how the connection of an object of the scene or program in operation is.
 *
 * reason: why it is lost or failed, or why all ended. overlaid: the settings that come from the server's cell file.
 * answering: false while the process that controls the devices does not answer; `state` is then the last known one.
 */
export interface ObjectStateData {
  object_id: string;
  state: Connection;
  reason?: string;
  overlaid?: string[];
  answering?: boolean;
}

/**
 * What clients know of an object type; category, icon and shadows are ours, beside the protocol.
 *
 * built_in: a base class or an installed type, which cannot be deleted. shadows: distribution and version of the
 * installed type of the same name that this uploaded one takes the place of.
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
  disabled: boolean;
  problem?: string;
  settings: ParameterMeta[];
  modified?: string;
  category?: string;
  icon?: string;
  shadows?: string;
}

/** What the event OpenProject carries. */
export interface OpenProjectData {
  scene: Scene;
  project: Project;
}

/** What the event OpenScene carries. */
export interface OpenSceneData {
  scene: Scene;
}

/**
 * A unit quaternion x, y, z, w. It is normalised whenever it is constructed.
 *
 * Raises ValueError for the zero quaternion and for numbers that are not finite.
 */
export interface Orientation {
  x: number;
  y: number;
  z: number;
  w: number;
}

/** What the event PackageInfo carries. */
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

/** What the event PackageState carries. */
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

/** `value` is a JSON document inside a string. */
export interface Parameter {
  name: string;
  type: string;
  value: string;
}

/**
 * One parameter of an action or setting; `extra` and `default_value` are JSON in strings.
 *
 * former_names: names under which older projects give it (ours, beside the protocol).
 * secret: the value of this setting is stored by the server and never sent to clients.
 * address: whether this setting says where the device is; left out where its name decides.
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
}

/** Values of PivotEnum in UpdateObjectPoseUsingRobot. */
export type Pivot = "top" | "middle" | "bottom";

/** Position and orientation of a frame in its parent frame. */
export interface Pose {
  position: Position;
  orientation: Orientation;
}

/** A point, or a displacement, in metres. */
export interface Position {
  x: number;
  y: number;
  z: number;
}

/**
 * What a user looks at and edits, as his client says.
 *
 * document: id of the scene, project or package that he sees. selected, aimed, editing: ids in it. view: the screen
 * or view he is in, in his client's words. camera: from where he looks, in the world, as the frame of a camera.
 */
export interface Presence {
  document: string;
  selected: string[];
  aimed?: string;
  editing?: string;
  view: string;
  camera?: Pose;
}

/** What the event ProcessState carries. */
export interface ProcessStateData {
  id: string;
  state: ProcessStateEnum;
  message?: string;
}

/** Values of StateEnum in ProcessState. */
export type ProcessStateEnum = "started" | "finished" | "failed";

/** A project with all that belongs to it. */
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
}

/** The shared breakpoints of a project: ids of its action points and actions, and who changed them last. */
export interface ProjectBreakpoints {
  project_id: string;
  ids: string[];
  user?: string;
}

/** What the event ProjectException carries; action_id: in which action it was, beside the protocol. */
export interface ProjectExceptionData {
  message: string;
  type: string;
  handled: boolean;
  action_id?: string;
}

/** A named group of actions with logic of its own. */
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

/** A constant of the project. */
export interface ProjectParameter {
  name: string;
  type: string;
  value: string;
  range?: Range;
  display_name?: string;
  description?: string;
  id: string;
}

/** Joint values of one robot, kept at an action point; rad, m where prismatic. */
export interface ProjectRobotJoints {
  name: string;
  robot_id: string;
  joints: Joint[];
  is_valid: boolean;
  arm_id?: string;
  end_effector_id?: string;
  id: string;
}

/** An inclusive range. */
export interface Range {
  min: number;
  max: number;
}

/** Whether an end effector gets somewhere. */
export type Reach = "reachable" | "near_limit" | "in_collision" | "out_of_reach" | "unknown";

/** Whether an end effector gets to an orientation or joints; `reason` is a sentence, where it does not. */
export interface ReachOfItem {
  id: string;
  reach: Reach;
  reason?: string;
}

/**
 * Arguments of Reachability: of which robot, arm and end effector, else of all; for which items, else for all.
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
 * What Reachability answers for each end effector, and the event ReachabilityChanged carries.
 *
 * revision: of the document for which it holds. items: orientations and joints of the open project; in the event,
 * those that changed.
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

/** Arguments of Redo: which undo of the caller, else his latest one. */
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

/** Arguments of RemoveAction. With `with_steps` the action is taken out of the logic first, by the same edit. */
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

/** Arguments of RemoveLogicItem. */
export interface RemoveLogicItemArgs {
  logic_item_id: string;
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

/** Arguments of RestoreRevision: the document as it was after the edit of that number. */
export interface RestoreRevisionArgs {
  revision: number;
}

/** What RestoreRevision answers: the revision there is now. */
export interface RestoreRevisionData {
  revision: number;
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

/** What the event RobotEef carries; `time_ms` (steady clock of the cell) where StreamRobot asked for it. */
export interface RobotEefData {
  robot_id: string;
  end_effectors: EefPose[];
  time_ms?: number;
}

/** Values of RegisterEnum in RegisterForRobotEvent. */
export type RobotEventKind = "eef_pose" | "joints";

/** Which optional methods a robot type implements; the last three are ours, beside the protocol. */
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
 * What the event RobotHold carries: a user took hold of a robot, or the hold has ended and the robot is at rest.
 *
 * reason: why it ended, where the user did not simply let go.
 */
export interface RobotHoldData {
  robot_id: string;
  kind: HoldKind;
  user: string;
  held: boolean;
  reason?: string;
  arm_id?: string;
}

/** What the event RobotJoints carries; `time_ms` as in RobotEef. */
export interface RobotJointsData {
  robot_id: string;
  joints: Joint[];
  time_ms?: number;
}

/** What clients know of a robot type. */
export interface RobotMeta {
  type: string;
  robot_type: RobotType;
  multi_arm: boolean;
  features: RobotFeatures;
  urdf_package_filename?: string;
}

/** What the event RobotMoveToActionPointJoints carries. */
export interface RobotMoveToActionPointJointsData {
  move_event_type: MoveEventType;
  robot_id: string;
  joints_id: string;
  safe: boolean;
  message?: string;
  arm_id?: string;
}

/** What the event RobotMoveToActionPointOrientation carries. */
export interface RobotMoveToActionPointOrientationData {
  move_event_type: MoveEventType;
  robot_id: string;
  end_effector_id: string;
  orientation_id: string;
  safe: boolean;
  linear: boolean;
  message?: string;
  arm_id?: string;
}

/** What the event RobotMoveToJoints carries. */
export interface RobotMoveToJointsData {
  move_event_type: MoveEventType;
  robot_id: string;
  target_joints: Joint[];
  safe: boolean;
  message?: string;
  arm_id?: string;
}

/** What the event RobotMoveToPose carries. */
export interface RobotMoveToPoseData {
  move_event_type: MoveEventType;
  robot_id: string;
  end_effector_id: string;
  target_pose: Pose;
  safe: boolean;
  linear: boolean;
  message?: string;
  arm_id?: string;
}

/** Kinds of arm. */
export type RobotType = "articulated" | "cartesian" | "scara";

/**
 * One run of a package.
 *
 * project_modified: of the project that was built, which says its revision. temporary: run from the editor, its
 * package is gone. started_by, stopped_by: a user's or token's name. actions: how many were begun. last_action: what
 * it was in when it ended. error: what ended it, as ProjectException has it.
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
}

/** How a run ended: as meant, by somebody, by an error, or with the server or its host. */
export type RunEnd = "running" | "finished" | "stopped" | "failed" | "lost";

/**
 * Arguments of RunPackage.
 *
 * shared_breakpoints: beside `breakpoints`, those that the project has (SetBreakpoints).
 */
export interface RunPackageArgs {
  id: string;
  start_paused?: boolean;
  breakpoints?: string[];
  shared_breakpoints?: boolean;
}

/** A scene with its objects. */
export interface Scene {
  name: string;
  description: string;
  created?: string;
  modified?: string;
  int_modified?: string;
  id: string;
  objects: SceneObject[];
}

/** One object; `pose` is set exactly when its type has one. */
export interface SceneObject {
  name: string;
  type: string;
  pose?: Pose;
  parameters: Parameter[];
  id: string;
}

/** Settings of one scene object that a project replaces. */
export interface SceneObjectOverride {
  id: string;
  parameters: Parameter[];
}

/** What the event SceneState carries. */
export interface SceneStateData {
  state: SceneStateEnum;
  message?: string;
}

/** Values of StateEnum in SceneState. */
export type SceneStateEnum = "stopped" | "starting" | "started" | "stopping";

/** Arguments of SetBreakpoints: ids of action points and actions of a project, else of the open one. */
export interface SetBreakpointsArgs {
  add?: string[];
  remove?: string[];
  project_id?: string;
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

/** Arguments of SetViewState: values by their keys; null takes one away, those that are not named stay. */
export interface SetViewStateArgs {
  scope: ViewScope;
  values: Record<string, unknown>;
  document?: string;
}

/** What SetViewState answers: the revision of the view state that there is now. */
export interface SetViewStateData {
  revision: number;
}

/** How bad an alarm is. */
export type Severity = "info" | "warning" | "error" | "critical";

/** What the event ShowMainScreen carries. */
export interface ShowMainScreenData {
  what: MainScreen;
  highlight?: string;
}

/** A sphere around its origin, m. */
export interface Sphere {
  id: string;
  radius: number;
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

/** Answer of StopAll: an outcome for everything to which a stop was sent, or which cannot be stopped. */
export interface StopAllData {
  outcomes: StopOutcome[];
}

/** What a stop applies to. */
export type StopKind = "device" | "action" | "program";

/**
 * The result of StopAll for one device, the action that is being tried, or the program.
 *
 * id, name: of the scene object, the action or the package. reason: why it was not stopped.
 */
export interface StopOutcome {
  kind: StopKind;
  id: string;
  name: string;
  stopped: boolean;
  reason?: string;
}

/** Arguments of StopRobot. */
export interface StopRobotArgs {
  robot_id: string;
}

/** Arguments of StreamRobot: RobotJoints or RobotEef of a robot, 1 to 30 times a second, or no longer. */
export interface StreamRobotArgs {
  robot_id: string;
  what: RobotEventKind;
  rate?: number;
  send?: boolean;
}

/**
 * Arguments of SubscribeEvents: names of additional events, to be sent to this client or no longer.
 *
 * users: whose view state ViewStateChanged tells, beside that of the user who is logged in here.
 */
export interface SubscribeEventsArgs {
  events: string[];
  send?: boolean;
  users?: string[];
}

/** What SystemInfo answers. */
export interface SystemInfoData {
  version: string;
  api_version: string;
  supported_parameter_types: string[];
  supported_rpc_requests: string[];
}

/** Arguments of TakeOverLocks: a user who left. */
export interface TakeOverLocksArgs {
  user: string;
}

/** What TakeOverLocks answers: the locks that were released. */
export interface TakeOverLocksData {
  locks: HeldLock[];
}

/** What kind of work takes its time. */
export type TaskKind = "scene_start" | "scene_stop" | "build" | "calibration" | "upload" | "download" | "computation";

/** How a task stands. */
export type TaskProgress = "running" | "finished" | "failed" | "cancelled";

/**
 * What the event TaskState carries.
 *
 * title: a sentence for people. started_by: a user's or token's name, left out where nobody asked for it.
 * progress: 0..1, left out where it is not known. message: what is being done, or why it failed.
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
}

/**
 * Arguments of TemporaryPackage.
 *
 * shared_breakpoints: beside `breakpoints`, those that the project has (SetBreakpoints).
 */
export interface TemporaryPackageArgs {
  start_paused?: boolean;
  breakpoints?: string[];
  shared_breakpoints?: boolean;
}

/**
 * One action of a run, from its end: what went in, what came out, how long it took.
 *
 * number: counts the actions of the run from 1, in the order in which they were announced. started: when that was.
 * duration: s, without a pause before it; left out while it runs. parameters, results: as in ActionStateBefore and
 * ActionStateAfter. error: why it failed. thread_id: left out in the script's main thread.
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
}

/** Arguments of GetActions. */
export interface TypeArgs {
  type: string;
}

/** Arguments of Undo: which edit of the caller, else his latest one in force. */
export interface UndoArgs {
  number?: number;
}

/** What Undo and Redo answer: the edit that was taken back, what had made it, and the revision there is now. */
export interface UndoData {
  number: number;
  request: string;
  revision: number;
}

/** Arguments of UpdateAction. */
export interface UpdateActionArgs {
  action_id: string;
  parameters?: ActionParameter[];
  flows?: Flow[];
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

/** Arguments of UpdateLock. */
export interface UpdateLockArgs {
  object_id: string;
  new_type: LockType;
}

/** Arguments of UpdateLogicItem. */
export interface UpdateLogicItemArgs {
  logic_item_id: string;
  start: string;
  end: string;
  condition?: ProjectLogicIf;
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

/** What the event UserPresence carries; without `presence` the user's client has not said anything yet. */
export interface UserPresenceData {
  user: string;
  online: boolean;
  role: string;
  presence?: Presence;
}

/** Whose a part of the view state is. */
export type ViewScope = "user" | "shared";

/**
 * The view state of a document, or what of it was changed: there, null stands for a value that went.
 *
 * document: id of a scene, project or package; empty: of none. user: whose, with scope user. revision: grows with
 * every change, so that an answer and an event can be put in order.
 */
export interface ViewState {
  scope: ViewScope;
  values: Record<string, unknown>;
  revision: number;
  document: string;
  user?: string;
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

/** Arguments and answer of each request. */
export interface Requests {
  AcknowledgeStop: { args: AcknowledgeStopArgs; data: undefined };
  ActionParamValues: { args: ActionParamValuesArgs; data: string[] };
  AddAction: { args: AddActionArgs; data: undefined };
  AddActionPoint: { args: AddActionPointArgs; data: undefined };
  AddActionPointJointsUsingRobot: { args: AddActionPointJointsUsingRobotArgs; data: undefined };
  AddActionPointOrientation: { args: AddActionPointOrientationArgs; data: undefined };
  AddActionPointOrientationUsingRobot: { args: AddActionPointOrientationUsingRobotArgs; data: undefined };
  AddApUsingRobot: { args: AddApUsingRobotArgs; data: undefined };
  AddLogicItem: { args: AddLogicItemArgs; data: undefined };
  AddObjectToScene: { args: AddObjectToSceneArgs; data: undefined };
  AddOverride: { args: AddOverrideArgs; data: undefined };
  AddProjectParameter: { args: AddProjectParameterArgs; data: undefined };
  AddVirtualCollisionObjectToScene: { args: AddVirtualCollisionObjectToSceneArgs; data: undefined };
  Authenticate: { args: AuthenticateArgs; data: AuthenticateData };
  BuildProject: { args: BuildProjectArgs; data: BuildProjectData };
  CalibrateCamera: { args: CalibrateCameraArgs; data: undefined };
  CalibrateRobot: { args: CalibrateRobotArgs; data: undefined };
  CameraColorImage: { args: CameraColorImageArgs; data: string };
  CameraColorParameters: { args: CameraColorParametersArgs; data: CameraParameters };
  CancelAction: { args: undefined; data: undefined };
  CheckCalibration: { args: CheckCalibrationArgs; data: CalibrationCheck };
  CloseProject: { args: CloseProjectArgs | undefined; data: undefined };
  CloseScene: { args: CloseSceneArgs | undefined; data: undefined };
  CopyActionPoint: { args: CopyActionPointArgs; data: undefined };
  CopyProject: { args: CopyProjectArgs; data: undefined };
  CopyScene: { args: CopySceneArgs; data: string };
  DeleteObjectTypes: { args: string[] | undefined; data: DeleteObjectTypesData[] };
  DeleteOverride: { args: DeleteOverrideArgs; data: undefined };
  DeletePackage: { args: IdArgs; data: undefined };
  DeleteProject: { args: IdArgs; data: undefined };
  DeleteScene: { args: IdArgs; data: string[] };
  ExecuteAction: { args: ExecuteActionArgs; data: undefined };
  ForwardKinematics: { args: ForwardKinematicsArgs; data: Pose };
  GetActions: { args: TypeArgs; data: ObjectAction[] };
  GetBreakpoints: { args: GetBreakpointsArgs | undefined; data: ProjectBreakpoints };
  GetCameraPose: { args: GetCameraPoseArgs; data: EstimatedPose };
  GetEndEffectorPose: { args: GetEndEffectorPoseArgs; data: Pose };
  GetEndEffectors: { args: GetEndEffectorsArgs; data: string[] };
  GetExecutionTrace: { args: GetExecutionTraceArgs | undefined; data: GetExecutionTraceData };
  GetGrippers: { args: GetGrippersArgs; data: string[] };
  GetObjectTypes: { args: undefined; data: ObjectTypeMeta[] };
  GetProject: { args: IdArgs; data: Project };
  GetRobotArms: { args: GetRobotArmsArgs; data: string[] };
  GetRobotJoints: { args: GetRobotJointsArgs; data: Joint[] };
  GetRobotMeta: { args: undefined; data: RobotMeta[] };
  GetScene: { args: IdArgs; data: Scene };
  GetSuctions: { args: GetSuctionsArgs; data: string[] };
  GetViewState: { args: GetViewStateArgs; data: ViewState };
  HandTeachingMode: { args: HandTeachingModeArgs; data: undefined };
  History: { args: HistoryArgs | undefined; data: HistoryData };
  HoldHandTeaching: { args: HoldHandTeachingArgs; data: undefined };
  InverseKinematics: { args: InverseKinematicsArgs; data: Joint[] };
  JogRobot: { args: JogRobotArgs; data: JogRobotData };
  ListCalibrations: { args: ListCalibrationsArgs | undefined; data: ListCalibrationsData };
  ListLocks: { args: undefined; data: LockHolder[] };
  ListPackages: { args: undefined; data: PackageSummary[] };
  ListProjects: { args: undefined; data: ListProjectsData[] };
  ListRuns: { args: ListRunsArgs | undefined; data: ListRunsData };
  ListScenes: { args: undefined; data: ListScenesData[] };
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
  ProjectsWithScene: { args: IdArgs; data: string[] };
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
  RemoveLogicItem: { args: RemoveLogicItemArgs; data: undefined };
  RemoveProjectParameter: { args: RemoveProjectParameterArgs; data: undefined };
  RenameAction: { args: RenameActionArgs; data: undefined };
  RenameActionPoint: { args: RenameActionPointArgs; data: undefined };
  RenameActionPointJoints: { args: RenameActionPointJointsArgs; data: undefined };
  RenameActionPointOrientation: { args: RenameActionPointOrientationArgs; data: undefined };
  RenameObject: { args: RenameArgs; data: undefined };
  RenamePackage: { args: RenamePackageArgs; data: undefined };
  RenameProject: { args: RenameProjectArgs; data: undefined };
  RenameScene: { args: RenameArgs; data: undefined };
  RestoreRevision: { args: RestoreRevisionArgs; data: RestoreRevisionData };
  ResumePackage: { args: undefined; data: undefined };
  RetryObject: { args: RetryObjectArgs; data: undefined };
  RunPackage: { args: RunPackageArgs; data: undefined };
  SaveProject: { args: undefined; data: undefined };
  SaveScene: { args: undefined; data: undefined };
  SceneObjectUsage: { args: IdArgs; data: string[] };
  SetBreakpoints: { args: SetBreakpointsArgs; data: ProjectBreakpoints };
  SetEefPerpendicularToWorld: { args: SetEefPerpendicularToWorldArgs; data: undefined };
  SetViewState: { args: SetViewStateArgs; data: SetViewStateData };
  StartScene: { args: undefined; data: undefined };
  StartSceneKeepGoing: { args: undefined; data: undefined };
  StepAction: { args: undefined; data: undefined };
  StepRobotEef: { args: StepRobotEefArgs; data: undefined };
  StopAll: { args: undefined; data: StopAllData };
  StopPackage: { args: undefined; data: undefined };
  StopRobot: { args: StopRobotArgs; data: undefined };
  StopScene: { args: undefined; data: undefined };
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
  UpdateLock: { args: UpdateLockArgs; data: undefined };
  UpdateLogicItem: { args: UpdateLogicItemArgs; data: undefined };
  UpdateObjectModel: { args: UpdateObjectModelArgs; data: undefined };
  UpdateObjectParameters: { args: UpdateObjectParametersArgs; data: undefined };
  UpdateObjectPose: { args: UpdateObjectPoseArgs; data: undefined };
  UpdateObjectPoseUsingRobot: { args: UpdateObjectPoseUsingRobotArgs; data: undefined };
  UpdateOverride: { args: UpdateOverrideArgs; data: undefined };
  UpdatePresence: { args: Presence; data: undefined };
  UpdateProjectDescription: { args: UpdateProjectDescriptionArgs; data: undefined };
  UpdateProjectHasLogic: { args: UpdateProjectHasLogicArgs; data: undefined };
  UpdateProjectParameter: { args: UpdateProjectParameterArgs; data: undefined };
  UpdateSceneDescription: { args: UpdateSceneDescriptionArgs; data: undefined };
  UploadPackage: { args: UploadPackageArgs; data: undefined };
  WriteLock: { args: WriteLockArgs; data: undefined };
  WriteUnlock: { args: WriteUnlockArgs; data: undefined };
}

/** The data of each event. */
export interface Events {
  ActionCancelled: undefined;
  ActionChanged: BareAction;
  ActionExecution: ActionExecutionData;
  ActionPointChanged: BareActionPoint;
  ActionResult: ActionResultData;
  ActionStateAfter: ActionStateAfterData;
  ActionStateBefore: ActionStateBeforeData;
  BreakpointsChanged: ProjectBreakpoints;
  ChangedObjectTypes: ObjectTypeMeta[];
  ExecutionTrace: TraceEntry;
  HandTeachingMode: HandTeachingModeData;
  HistoryChanged: HistoryChangedData;
  JointsChanged: ProjectRobotJoints;
  LogicItemChanged: LogicItem;
  MovePreview: MovePreviewData;
  Notification: NotificationData;
  ObjectHealth: ObjectHealthData;
  ObjectState: ObjectStateData;
  ObjectsLocked: LockData;
  ObjectsUnlocked: LockData;
  OpenProject: OpenProjectData;
  OpenScene: OpenSceneData;
  OrientationChanged: NamedOrientation;
  OverrideUpdated: Parameter;
  PackageChanged: PackageSummary;
  PackageInfo: PackageInfoData;
  PackageState: PackageStateData;
  ProcessState: ProcessStateData;
  ProjectChanged: BareProject;
  ProjectClosed: undefined;
  ProjectException: ProjectExceptionData;
  ProjectParameterChanged: ProjectParameter;
  ProjectSaved: undefined;
  ReachabilityChanged: ReachabilityData;
  RobotEef: RobotEefData;
  RobotHold: RobotHoldData;
  RobotJoints: RobotJointsData;
  RobotMoveToActionPointJoints: RobotMoveToActionPointJointsData;
  RobotMoveToActionPointOrientation: RobotMoveToActionPointOrientationData;
  RobotMoveToJoints: RobotMoveToJointsData;
  RobotMoveToPose: RobotMoveToPoseData;
  RunChanged: Run;
  SceneChanged: BareScene;
  SceneClosed: undefined;
  SceneObjectChanged: SceneObject;
  SceneSaved: undefined;
  SceneState: SceneStateData;
  ShowMainScreen: ShowMainScreenData;
  TaskState: TaskStateData;
  UserPresence: UserPresenceData;
  ViewStateChanged: ViewState;
}

/** An event as it comes. */
export type ServerEvent = {
  [Name in keyof Events]: {
    event: Name;
    data: Events[Name];
    change_type?: ChangeType;
    parent_id?: string;
  };
}[keyof Events];

/** Roles, each of which may do what the ones before may. */
export const ROLES = {
  operator: 1,
  standard_user: 2,
  advanced_user: 3,
  technician: 4,
  programmer: 5,
} as const;

/** The least role of each request. */
export const LEAST_ROLE: Record<keyof Requests, number> = {
  AcknowledgeStop: 1,
  ActionParamValues: 2,
  AddAction: 2,
  AddActionPoint: 2,
  AddActionPointJointsUsingRobot: 2,
  AddActionPointOrientation: 2,
  AddActionPointOrientationUsingRobot: 2,
  AddApUsingRobot: 2,
  AddLogicItem: 2,
  AddObjectToScene: 4,
  AddOverride: 3,
  AddProjectParameter: 3,
  AddVirtualCollisionObjectToScene: 4,
  Authenticate: 1,
  BuildProject: 2,
  CalibrateCamera: 4,
  CalibrateRobot: 4,
  CameraColorImage: 1,
  CameraColorParameters: 1,
  CancelAction: 1,
  CheckCalibration: 1,
  CloseProject: 2,
  CloseScene: 2,
  CopyActionPoint: 2,
  CopyProject: 2,
  CopyScene: 4,
  DeleteObjectTypes: 5,
  DeleteOverride: 3,
  DeletePackage: 3,
  DeleteProject: 2,
  DeleteScene: 4,
  ExecuteAction: 2,
  ForwardKinematics: 2,
  GetActions: 1,
  GetBreakpoints: 1,
  GetCameraPose: 4,
  GetEndEffectorPose: 1,
  GetEndEffectors: 1,
  GetExecutionTrace: 1,
  GetGrippers: 1,
  GetObjectTypes: 1,
  GetProject: 1,
  GetRobotArms: 1,
  GetRobotJoints: 1,
  GetRobotMeta: 1,
  GetScene: 1,
  GetSuctions: 1,
  GetViewState: 1,
  HandTeachingMode: 2,
  History: 1,
  HoldHandTeaching: 2,
  InverseKinematics: 2,
  JogRobot: 2,
  ListCalibrations: 1,
  ListLocks: 1,
  ListPackages: 1,
  ListProjects: 1,
  ListRuns: 1,
  ListScenes: 1,
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
  ProjectsWithScene: 1,
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
  RemoveLogicItem: 2,
  RemoveProjectParameter: 3,
  RenameAction: 2,
  RenameActionPoint: 2,
  RenameActionPointJoints: 2,
  RenameActionPointOrientation: 2,
  RenameObject: 4,
  RenamePackage: 3,
  RenameProject: 2,
  RenameScene: 4,
  RestoreRevision: 2,
  ResumePackage: 1,
  RetryObject: 2,
  RunPackage: 1,
  SaveProject: 2,
  SaveScene: 4,
  SceneObjectUsage: 1,
  SetBreakpoints: 2,
  SetEefPerpendicularToWorld: 2,
  SetViewState: 1,
  StartScene: 2,
  StartSceneKeepGoing: 2,
  StepAction: 1,
  StepRobotEef: 2,
  StopAll: 1,
  StopPackage: 1,
  StopRobot: 1,
  StopScene: 2,
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
  UpdateLock: 2,
  UpdateLogicItem: 2,
  UpdateObjectModel: 4,
  UpdateObjectParameters: 4,
  UpdateObjectPose: 4,
  UpdateObjectPoseUsingRobot: 4,
  UpdateOverride: 3,
  UpdatePresence: 1,
  UpdateProjectDescription: 2,
  UpdateProjectHasLogic: 3,
  UpdateProjectParameter: 2,
  UpdateSceneDescription: 4,
  UploadPackage: 5,
  WriteLock: 2,
  WriteUnlock: 2,
};

/** Events beside the protocol, sent to who subscribed. */
export const ADDITIONAL_EVENTS = [
  "BreakpointsChanged",
  "ExecutionTrace",
  "HistoryChanged",
  "MovePreview",
  "ObjectHealth",
  "ObjectState",
  "ReachabilityChanged",
  "RobotHold",
  "RunChanged",
  "TaskState",
  "UserPresence",
  "ViewStateChanged",
] as const satisfies (keyof Events)[];
