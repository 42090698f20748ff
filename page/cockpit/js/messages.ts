// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the JSON messages between the page and its server: no code here.
 *
 * The server's side is crgame_ros/cockpit/scene.py (with map_lanelets.py and
 * road_furniture.py), run_status.py, seat_table.py, run_files.py,
 * library.py, replay_backend.py and, for the page's messages, page_messages.py. The binary frames
 * are in frames.js. Polylines and polygons are flat lists x0, y0, x1, y1, … [m].
 *
 * @typedef {[xmin: number, ymin: number, xmax: number, ymax: number]} Box [m]
 * @typedef {{x: number, y: number, yaw: number, speed: number}} Pose [m, rad, m/s]
 */

export {};

/** @import { PeopleMessage, Rights, YouMessage } from './people_messages.js' */
/** @import { GameTask, TasksMessage } from './tasks/task_messages.js' */

/**
 * @typedef {object} Shape
 * @property {'rectangle'|'circle'|'polygon'} kind
 * @property {number} length [m]
 * @property {number} width [m]
 * @property {number[]} vertices of a polygon, flat
 */

/**
 * @typedef {object} Lanelet
 * @property {number} id
 * @property {number[]} left bound
 * @property {number[]} right bound
 * @property {number[]} center line
 * @property {number[]|null} [left_z] heights of the left bound's points [m], null where flat
 * @property {number[]|null} [right_z]
 * @property {string[]} types CommonRoad's
 * @property {string} left_line marking of the bound, as CommonRoad calls it
 * @property {string} right_line
 * @property {boolean} one_way
 * @property {number|null} speed_limit [m/s]
 * @property {boolean} intersection
 * @property {number|null} adj_left id of the neighbour
 * @property {boolean} adj_left_same whether it leads the same way
 * @property {number|null} adj_right
 * @property {boolean} adj_right_same
 * @property {number[]} successors
 */

/**
 * A traffic light; `yaw` is the heading [rad] of the traffic that it controls.
 *
 * @typedef {{id: number, x: number, y: number, yaw: number, direction: string,
 *   lanelets: number[]}} Light
 */

/**
 * A traffic sign, named as in TrafficSignIDGermany and the like; `yaw` is its traffic's heading.
 *
 * @typedef {{id: number, x: number, y: number, yaw: number, lanelets: number[], kind: string,
 *   value: string, virtual: boolean}} Sign
 */

/** @typedef {{light: 'day'|'dusk', visibility: number}} Environment visibility [m] */

/**
 * Points of a vehicle: ahead of the rear axle, to the left, above the road.
 *
 * @typedef {[x: number, y: number, z: number]} Mount [m]
 * @typedef {{height: number, bonnet_height: number, eye: Mount, left_mirror: Mount,
 *   right_mirror: Mount, inner_mirror: Mount|null}} DriverPlace [m]; a vehicle without an inner
 *   mirror has no cabin
 */

/**
 * @typedef {object} SceneVehicle
 * @property {string} id
 * @property {'human'|'autonomous'} role
 * @property {Shape} shape
 * @property {number} rear_to_center [m]
 * @property {number} wheelbase [m]
 * @property {number} max_steering_angle [rad]
 * @property {string} type CommonRoad obstacle type
 * @property {'combustion'|'electric'|'muscle'} powertrain
 * @property {DriverPlace} driver_place
 * @property {{localisation: boolean, sensors: string[], range: number|null}|null} perception
 *   range [m], null for no limit
 */

/** @typedef {'recorded'|'static'|'traffic'|'scripted'} ObjectRole */
/** @typedef {{id: string, type: string, role: ObjectRole, shape: Shape}} SceneObject */

/**
 * The action of an event of the game, by its kind.
 *
 * @typedef {{kind: 'release', object: string}} ReleaseAction
 * @typedef {{kind: 'brake', object: string, deceleration: number, speed: number}} BrakeAction
 * @typedef {{kind: 'obstacle', x: number, y: number, length: number, width: number,
 *   type: string}} ObstacleAction
 * @typedef {{kind: 'speed_limit', speed: number, lanelets: number[]}} SpeedLimitAction
 * @typedef {{kind: 'plan_display', av: string, show: boolean}} PlanDisplayAction
 * @typedef {{kind: 'planner', av: string, planner: string}} PlannerAction
 * @typedef {{kind: 'planner_run', av: string, run: boolean}} PlannerRunAction
 * @typedef {ReleaseAction|BrakeAction|ObstacleAction|SpeedLimitAction|TrafficAction
 *   |PlanDisplayAction|PlannerAction|PlannerRunAction} EventAction
 */

/**
 * @typedef {object} TrafficAction
 * @property {'traffic'} kind
 * @property {string} agent id, or all
 * @property {Record<string, unknown>} [options]
 * @property {number} [speed_factor]
 * @property {number} [desired_speed] [m/s]
 * @property {number} [politeness]
 * @property {boolean} [lane_changes]
 * @property {number} [reaction_time] [s]
 * @property {number} [imperfection]
 * @property {boolean} [red_runner]
 * @property {boolean} [late_yielder]
 */

/**
 * @typedef {{time: number}|{step: number}|{between: [string, string], distance: number}
 *   |{vehicle: string, x: number, y: number, radius: number}} EventCondition
 * @typedef {{name: string, label: string, when: EventCondition|null} & EventAction} GameEvent
 */

/**
 * @typedef {object} SceneTime
 * @property {number} epoch counts resets
 * @property {number} dt_s
 * @property {number} dt_c_s of a scenario step
 * @property {number} k0
 * @property {number} clock_offset_s
 * @property {number|null} duration_s
 */

/**
 * @typedef {object} Scene everything that does not change during a run
 * @property {string} id
 * @property {string} benchmark_id
 * @property {string} title
 * @property {Box} bounds
 * @property {string} country three letters, ZAM if unknown
 * @property {Environment} environment
 * @property {Lanelet[]} lanelets
 * @property {number[][]} gaps slits between lanelets, for display only
 * @property {{points: number[], lanelet: number, line: string}[]} stop_lines
 * @property {Light[]} lights
 * @property {Sign[]} signs
 * @property {SceneVehicle[]} vehicles
 * @property {SceneObject[]} objects
 * @property {{av: string, polygons: number[][]}[]} goals
 * @property {SceneTime} time
 * @property {Record<string, string>} drivers
 * @property {Record<string, string>} planners
 * @property {boolean} occupancy whether there is a map of permanent obstacles
 * @property {GameEvent[]} events
 * @property {GameTask[]} [tasks]
 * @property {string} [language] of the texts for drivers
 * @property {'through'|'stop'} contact what a contact does to a vehicle that a person drives
 * @property {'on'|'none'} sound whether pages may sound and gamepads rumble
 * @property {number} [again] counts how often a recording was played
 */

/** @typedef {{client: string, name: string}} Person */

/**
 * @typedef {object} Seat
 * @property {string} source of the commands that the vehicle obeys
 * @property {string} driver the source that the game names
 * @property {string|null} holder id of a client
 * @property {string|null} holder_name
 * @property {Person[]} [requests] persons that ask for it
 * @property {Person[]} [others] persons that could get it
 * @property {Person|null} [offer] person to which its holder offers it
 * @property {{name: string, for_s: number}|null} [kept] for its absent driver, and how long
 * @property {boolean} [ready] whether its driver is ready to begin
 * @property {string} [device] of its driver, as its page reports it
 * @property {boolean} [lost] whether its driver is silent
 */

/** @typedef {{name: string, n: number, k: number, by: string}} FiredEvent */

/**
 * @typedef {object} Alarm
 * @property {string} id
 * @property {string} kind
 * @property {string} subject
 * @property {string} text
 * @property {number} [since_t] [s]
 */

/** @typedef {'waiting'|'running'|'paused'|'ended'} RunState */

/**
 * @typedef {object} Recording
 * @property {'none'|'recording'|'recorded'|'failed'|'unknown'} state
 * @property {number} [messages]
 * @property {number} [megabytes]
 * @property {string} [text]
 */

/**
 * @typedef {object} PlannerStatus
 * @property {boolean} running
 * @property {boolean} stale
 * @property {number|null} latency_ms
 * @property {number|null} age_ms
 * @property {number} accepted
 * @property {number} refused
 * @property {number} of_others plans of other programs than its planner
 * @property {string} failure why it braked last
 * @property {number|null} plan_time_ms
 * @property {number|null} fallbacks
 * @property {string} planner
 * @property {string} last_refusal
 * @property {Record<string, number|null>|null} tracking
 */

/**
 * Figures and texts of the time-sync supervisor by key; in timing.json some are nested.
 *
 * @typedef {Record<string, number|boolean|string|null|undefined|Record<string, number|null>>
 *   } Timing
 */

/** @typedef {{vehicle: string, with: string, t: number}} Contact */
/** @typedef {{vehicle: string, with: string, side: string, avoidable_by: string}} NamedContact */

/**
 * A measure of criticality.
 *
 * @typedef {object} Measure
 * @property {string} name
 * @property {string} label
 * @property {string} unit
 * @property {-1|1} worst whether smaller (-1) or greater (1) values are more critical
 * @property {number|null} limit beyond which it is critical; null for none
 * @property {string} definition
 */

/**
 * A measure of a vehicle over a whole run.
 *
 * @typedef {object} Exposure
 * @property {string} name
 * @property {string} label
 * @property {string} unit
 * @property {string} definition
 */

/**
 * The worst values so far by measure, and the thresholds of criticality.
 *
 * @typedef {object} Criticality
 * @property {boolean} critical now
 * @property {Record<string, number|null>} exposures over the run so far, by name
 * @property {Record<string, {value: number|null, of: string, t: number|null}>} worst
 * @property {Record<string, number|null>} thresholds
 */

/**
 * @typedef {object} Status
 * @property {RunState} run
 * @property {string} [reason] why it ended
 * @property {boolean} [stays] whether the program continues after the run
 * @property {string[]} [awaited] seats without a driver
 * @property {number} [countdown_s] until the run begins; 0 for none
 * @property {Contact[]} [contacts]
 * @property {{vehicle: string, t: number}[]} [departures]
 * @property {number} real_time_factor
 * @property {number|null} measured_factor
 * @property {Recording} recording
 * @property {Timing|null} timing
 * @property {Record<string, PlannerStatus>} planners
 * @property {Record<string, {collision: boolean, off_road: boolean, hit: string[]}>} drivability
 * @property {Record<string, Criticality>} [criticality]
 * @property {Record<string, boolean>} seats_lost
 * @property {boolean} frames_skipped
 * @property {number} t [s]
 * @property {number} n
 * @property {number} k
 * @property {number} epoch
 * @property {number} clients
 */

/**
 * @typedef {object} Files
 * @property {number} epoch
 * @property {string} run id in /api/runs
 * @property {string} folder
 * @property {string[]} names
 * @property {boolean} complete
 * @property {NamedContact[]} contacts
 */

/**
 * The answers of /api/runs and /api/runs/score about a run.
 *
 * @typedef {object} PastRun
 * @property {string} id
 * @property {string} name
 * @property {string} title
 * @property {string} scenario
 * @property {number|null} began_ms since 1970
 * @property {number|null} duration_s of its recording
 * @property {number|null} contacts null if unknown
 * @property {boolean} closed whether it can be read
 * @property {boolean} finished whether it can be deleted
 * @property {boolean} own whether it belongs to this session
 * @property {number} bytes
 * @property {{name: string, bytes: number}[]} files
 *
 * @typedef {{name: string, value: number|null, weight: number, definition: string}} ScorePart
 * @typedef {object} VehicleScore
 * @property {string} vehicle
 * @property {string} role
 * @property {number|null} score of 1
 * @property {ScorePart[]} parts
 * @property {number|null} distance [m]
 * @property {number|null} fastest [m/s]
 * @property {string[]} remarks
 * @typedef {{vehicles: VehicleScore[], refusal: string}} Score
 */

/** @typedef {'info'|'warn'|'error'} NoticeLevel */

/**
 * Messages from the server to the store.
 *
 * @typedef {{type: 'hello', client: string, name: string, mode: 'live'|'replay',
 *   version: string, program?: string, rights: Rights, framed_by?: string,
 *   measures?: Measure[], exposures?: Exposure[]}} HelloMessage
 * @typedef {{type: 'scene'} & Scene} SceneMessage
 * @typedef {{type: 'seats', seats: Record<string, Seat>}} SeatsMessage
 * @typedef {{type: 'signals', k: number, states: Record<string, string>,
 *   objects: Record<string, number>}} SignalsMessage
 * @typedef {{type: 'events', fired: FiredEvent[]}} EventsMessage
 * @typedef {{type: 'alarms', active: Alarm[]}} AlarmsMessage
 * @typedef {{type: 'status'} & Status} StatusMessage
 * @typedef {{type: 'files'} & Files} FilesMessage
 * @typedef {{type: 'notice', level: NoticeLevel, text: string}} NoticeMessage
 * @typedef {HelloMessage|SceneMessage|SeatsMessage|SignalsMessage|EventsMessage|AlarmsMessage
 *   |StatusMessage|FilesMessage|NoticeMessage|YouMessage|PeopleMessage|TasksMessage} StoreMessage
 */

/**
 * Answers of the server to one page.
 *
 * @typedef {{ok: boolean, text: string}} Reply
 * @typedef {{type: 'reply', to: number} & Reply} ReplyMessage
 * @typedef {{type: 'pong', t: number}} PongMessage
 * @typedef {StoreMessage|ReplyMessage|PongMessage} ServerMessage
 */

/**
 * Messages from the page, as the server declares them; requests get their number when they are
 * sent.
 *
 * @typedef {import('./page_messages.js').PageMessage} PageMessage
 * @typedef {import('./page_messages.js').Unnumbered<PageMessage>} RequestMessage
 * @typedef {Omit<import('./page_messages.js').Input, 'type'|'seat'>} Hands
 * @typedef {import('./page_messages.js').Control['action']} RunAction
 * @typedef {import('./page_messages.js').SeenView} ViewMessage
 * @typedef {import('./page_messages.js').Role['role']} RoleName
 */

/**
 * Types of /api/scenarios, /api/preview, /api/planner and /api/load.
 *
 * @typedef {{id: string, kind: 'game'|'scenario'|'upload', name: string, title: string}} Entry
 * @typedef {{folders: {name: string, entries: Entry[]}[], planners: string[],
 *   drivers: string[]}} Offer
 * @typedef {{id: string, planner: string, planning_problem: number|null,
 *   options?: Record<string, string>}} PreviewAv
 * @typedef {{name: string, wanted: string, default: string, meaning: string}} PlannerOption
 * @typedef {object} Preview
 * @property {Scene} scene
 * @property {{vehicles: (number|null)[][], objects: (number|null)[][]}} states rows, as in frames
 * @property {{id: string, driver: string}[]} humans
 * @property {PreviewAv[]} avs
 * @property {string[]} notices
 */

/**
 * @typedef {object} Choice
 * @property {string} id of an entry
 * @property {{id: string, driver: string}[]} humans
 * @property {{id: string, planner: string, options?: Record<string, string>}[]} avs
 */
