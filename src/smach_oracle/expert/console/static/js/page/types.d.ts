// Shapes of the page itself: elements, and what the frame and its panels know of each other.
import { Connection } from './connection.js';
import { Liveness } from './liveness.js';
import { Store } from './store.js';
import { Question, Role } from '../server';

export as namespace page;
export { Connection, Liveness, Store };

declare global {
  interface Navigator { // of browsers of 2023 and later
    readonly userActivation?: { readonly hasBeenActive: boolean };
  }
}

/** What an element may hold: null, undefined and false are left out. */
export type Child = Node | string | number | false | null | undefined | Child[];

type Handlers = {
  [Type in keyof GlobalEventHandlersEventMap as `on${Type}`]?:
    ((event: GlobalEventHandlersEventMap[Type]) => void) | null;
};

type AttributeName = 'alt' | 'autocomplete' | 'checked' | 'class' | 'colspan' | 'cx' | 'cy' | 'd'
  | 'disabled' | 'for' | 'height' | 'href' | 'hidden' | 'id' | 'markerHeight' | 'markerUnits'
  | 'markerWidth' | 'marker-end' | 'max' | 'maxlength' | 'method' | 'min' | 'open' | 'orient'
  | 'placeholder' | 'r' | 'refX' | 'refY' | 'required' | 'role' | 'rows' | 'rx' | 'scope'
  | 'selected' | 'spellcheck' | 'src' | 'step' | 'tabindex' | 'text-anchor' | 'title'
  | 'transform' | 'type' | 'value' | 'viewBox' | 'width' | 'x' | 'x1' | 'x2' | 'y' | 'y1' | 'y2';

/** Attributes, properties of the style (--hue), listeners; `key`: which one it is, for redraw. */
export type Properties = Handlers & {
  [name in AttributeName | `data-${string}` | `aria-${string}` | `--${string}` | 'key']?:
    string | number | boolean | null | undefined;
};

/** The frame around the panels, as they know it. */
export interface App {
  readonly store: Store;
  readonly connection: Connection;
  readonly liveness: Liveness;
  readonly current: string; // id of the panel that is shown
  readonly role: Role | '';
  readonly expert: string;
  readonly mayAnswer: boolean;
  /** Whether this browser holds its claim. */
  isMine(question: Question): boolean;
  went(): void; // a person has turned to something: Back leads to what was shown before
}

/** One tab of the page. */
export interface Panel {
  id: string;
  title: string;
  create(app: App): PanelView;
}

export interface PanelView {
  readonly root: HTMLElement;
  /** The sections that it is drawn of: it is drawn as they change, while it is shown. */
  readonly sections: RegExp;
  /** Whether it is also drawn as they change while another panel is shown. */
  readonly always?: boolean;
  /**
   * It becomes a view of what there is now: as it comes, every second while it is shown, and as
   * sections of these names change.
   */
  draw(names?: string[]): void;
  /** It is shown now. */
  shown?(): void;
  /** The connection is there, again. */
  connected?(): void;
  /** What it shows, for the address; '' for what it opens with. */
  readonly place?: string;
  /** Show what an address names. */
  goTo?(place: string): void;
  /** How many things wait there. */
  badge?(): number;
}
