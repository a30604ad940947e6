/** Types whose actions control the program. They are always offered; their objects are added when they are needed. */
export const SERVICES: readonly string[] = ["FlowActions", "LogicActions", "CounterActions"];
