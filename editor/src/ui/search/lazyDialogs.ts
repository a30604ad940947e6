/** Dialogs that few users open. Their addresses are in a chunk of their own, which keeps the shell small. */

export const persons = () => import("../persons/Persons");
export const pin = () => import("../persons/ChangePin");
export const audit = () => import("../audit/AuditTrail");
export const interlocks = () => import("../interlocks/Interlocks");
export const cell = () => import("../cell/CellDialog");
export const production = () => import("../production/Production");
