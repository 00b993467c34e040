// Draws what nurbskin measures, for the application and for the report page.

export * from "./camera";
export * from "./colours";
export * from "./drawing";
export type { Lengths, Mark, Pin } from "./overlay";
export { blend, weightsOn, type OnTriangle } from "./picking";
export type { Layer, Plane, Settings } from "./stage";
export * from "./vectors";
export { Viewer, type Found, type Told } from "./viewer";
