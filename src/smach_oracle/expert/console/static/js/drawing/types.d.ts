// Shapes of what is drawn in 3D. Lengths are metres unless px is written beside them.
import { Raster } from './raster.js';

export as namespace drawing;

export type Vector = [x: number, y: number, z: number];

/** A frame's place in another: 3 x 4, by rows. */
export type Pose = ArrayLike<number>;

export type Box = [low: Vector, high: Vector];

/** Red, green, blue, 0 to 255 each. */
export type Colour = [red: number, green: number, blue: number];

/** From where a scene is looked at. The axes are those of the screen, in the scene's frame. */
export interface View {
  right: Vector;
  down: Vector;
  ahead: Vector;
  centre: Vector;
  distance: number;
  focal: number; // px
  width: number; // px
  height: number; // px
}

/** The canvas below a scene. */
export interface Paper {
  ratio: number; // px of the canvas for one px of the page
  ground: Colour; // of the background
}

/** One thing in a scene. */
export interface Layer {
  draw(raster: Raster, view: View, paper: Paper): void;
  /** The box around it; null where it has none. */
  bounds(): Box | null;
  readonly triangles?: number;
  readonly points?: Float32Array;
}

/** Points with their colours: (x, y, z, ...) and (red, green, blue, ...). */
export interface Points {
  points: Float32Array;
  colours: Uint8Array;
}

/** Triangles of a robot's part: corners (x, y, z, ...), and three corners' numbers for each. */
export interface Geometry {
  corners: Float32Array;
  triangles: Uint16Array;
  box: Box;
}

/** A geometry at a link of a robot: numbers of both, the link from the geometry, and its colour. */
export type Part = [link: number, geometry: number, pose: Pose, colour: Colour];

/** What a robot looks like. */
export interface RobotModel {
  name: string;
  version: string;
  links: string[];
  geometries: Geometry[];
  parts: Part[];
  missing: string[]; // meshes that cannot be read, and why; the first ones
  lost: number; // how many these are in all
}

/** From which side a scene is looked at. */
export interface Looks {
  azimuth?: number; // rad
  elevation?: number; // rad
  optical?: boolean; // the frame has z ahead and y down, as cameras have; others have z up
}
