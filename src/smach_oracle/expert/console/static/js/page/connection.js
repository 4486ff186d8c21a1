// @ts-check
// The connection to the server: it comes back by itself.

/** @typedef {'connecting' | 'signed-out' | 'connected' | 'lost'} State */
/**
 * @typedef {object} Waiting
 * @property {(reply: server.Reply) => void} resolve
 * @property {(err: Error) => void} reject
 * @property {number} timer for that no reply comes
 */

const SHORTEST_PAUSE_S = 0.3;
const LONGEST_PAUSE_S = 4;
const REQUEST_LIMIT_S = 20;
const SESSION_LIMIT_MS = 8000;
const SIGNED_OUT = 4001; // as the server closes the sockets of a session that has ended

/** There is no connection, or it went before the reply came. */
export class ConnectionLost extends Error {}

/** The connection is there, and no reply came in time: nobody knows whether it was carried out. */
export class NoReply extends ConnectionLost {}

/**
 * For `catch`: nothing where the connection was lost, which the page shows anyway.
 * @param {unknown} err
 */
export function unlessLost(err) {
  if (!(err instanceof ConnectionLost)) throw err;
}

export class Connection {
  /**
   * @param {page.Store} store
   * @param {(state: State) => void} onState
   * @param {() => void} onEnd the person has signed out on another page of this browser
   * @param {(name: keyof server.Commands, limit: number) => void} onNoReply to a command within
   *   so many s
   */
  constructor(store, onState, onEnd, onNoReply) {
    this.store = store;
    this.onNoReply = onNoReply;
    /** @type {import('./gate.js').Gate | null} */
    this.gate = null;
    this.onState = onState;
    this.onEnd = onEnd;
    /** @type {Map<number, Waiting>} */
    this.waiting = new Map(); // for the reply to a command
    this.number = 0; // of the last command
    this.pause = SHORTEST_PAUSE_S;
    this.timer = 0;
    this.generation = 0;
    /** @type {server.Session | null} */
    this.session = null;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.wantedExpert = ''; // the name that the person has chosen
    this.expert = ''; // the one under which the server knows this page
    this.browser = ''; // under which claims of this browser are known
    /** @type {State} */
    this.state = 'connecting';
    this.leaving = false;
    const hurry = () => this.hurry();
    window.addEventListener('online', hurry);
    window.addEventListener('focus', hurry);
    document.addEventListener('visibilitychange', hurry);
  }

  get connected() { return this.state === 'connected'; }

  /** @param {State} state */
  turn(state) {
    this.state = state;
    this.onState(state);
  }

  /** Signed out: another page of this browser may have signed in meanwhile. */
  hurry() {
    const waits = this.state === 'lost' || this.state === 'signed-out';
    if (waits && !document.hidden) this.connect();
  }

  async connect() {
    clearTimeout(this.timer);
    const generation = ++this.generation;
    this.fail();
    this.socket?.close();
    this.turn('connecting');
    try {
      const session = await this.whoAmI();
      if (generation !== this.generation) return;
      this.session = session;
    } catch (err) {
      if (generation === this.generation) this.retryLater();
      return;
    }
    if (this.session.signed_in) this.open(generation);
    else this.turn('signed-out');
  }

  /** @returns {Promise<server.Session>} */
  async whoAmI() {
    const limit = new AbortController();
    setTimeout(() => limit.abort(), SESSION_LIMIT_MS);
    const answer = await fetch('session', { cache: 'no-store', signal: limit.signal });
    if (!answer.ok) throw new ConnectionLost();
    return answer.json();
  }

  /** @param {number} generation */
  open(generation) {
    const address = new URL('socket', location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    const socket = this.socket = new WebSocket(address);
    socket.onmessage = (event) => this.receive(JSON.parse(event.data));
    socket.onclose = (event) => {
      if (event.code === SIGNED_OUT && !this.leaving) this.onEnd();
      if (generation !== this.generation) return;
      this.fail();
      this.retryLater();
    };
    socket.onopen = () => this.sayHello(generation);
  }

  /** @param {number} generation */
  async sayHello(generation) {
    try {
      const reply = await this.hello();
      if (!reply.ok || generation !== this.generation) return;
      this.pause = SHORTEST_PAUSE_S;
      this.turn('connected');
    } catch (err) {
      unlessLost(err);
    }
  }

  /** Say who uses this page: at first, and once a name is given. */
  async hello() {
    const { xsrf, wantedExpert: expert } = this;
    const reply = await this.request('hello', { xsrf, expert });
    if (reply.ok) {
      this.expert = reply.message;
      this.browser = reply.data?.browser || '';
    }
    return reply;
  }

  retryLater() {
    this.turn('lost');
    this.timer = setTimeout(() => this.connect(), this.pause * 1000);
    this.pause = Math.min(LONGEST_PAUSE_S, this.pause * 1.7);
  }

  /** Nothing that is asked for will be answered. */
  fail() {
    const lost = new ConnectionLost('the connection was lost');
    for (const number of [...this.waiting.keys()]) this.settle(number)?.reject(lost);
  }

  /**
   * Wait no longer; who has waited, undefined for nobody.
   * @param {number} number of the command
   */
  settle(number) {
    const waiting = this.waiting.get(number);
    this.waiting.delete(number);
    clearTimeout(waiting?.timer);
    return waiting;
  }

  /** @param {server.Batch | server.Reply} message */
  receive(message) {
    if (!('re' in message)) {
      this.store.receive(message);
      return;
    }
    this.settle(message.re)?.resolve(message);
  }

  /**
   * One command; rejects with ConnectionLost where the connection goes before the reply is there.
   * @template {keyof server.Commands} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   * @returns {Promise<server.Reply<Name>>}
   */
  request(name, args) {
    const first = this.gate?.before(name, /** @type {{ question?: string }} */ (args));
    if (!first) return this.post(name, args);
    return first.then((refusal) => (
      /** @type {server.Reply<Name> | null} */ (refusal) || this.post(name, args)));
  }

  /**
   * The same; where no reply comes it is not done, for a reason that the caller knows.
   * @template {keyof server.Commands} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   * @param {string | ((err: unknown) => string)} lost what is said then
   * @returns {Promise<Omit<server.Reply<Name>, 're'>>}
   */
  async ask(name, args, lost) {
    try {
      return await this.request(name, args);
    } catch (err) {
      unlessLost(err);
      return { ok: false, message: typeof lost === 'string' ? lost : lost(err) };
    }
  }

  /**
   * @template {keyof server.Commands} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   * @returns {Promise<server.Reply<Name>>}
   */
  post(name, args) {
    const socket = this.openSocket;
    if (!socket) return Promise.reject(new ConnectionLost('not connected'));
    const number = ++this.number;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => {
        this.waiting.delete(number);
        this.onNoReply(name, REQUEST_LIMIT_S);
        reject(new NoReply('no reply within ' + REQUEST_LIMIT_S + ' s'));
      }, REQUEST_LIMIT_S * 1000);
      this.waiting.set(number, { reject, timer,
        resolve: /** @type {(reply: server.Reply) => void} */ (resolve) });
      socket.send(JSON.stringify({ id: number, do: name, ...args, ...this.gate?.beside(name) }));
    });
  }

  /**
   * A command whose reply nobody waits for.
   * @template {keyof server.Commands} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   * @param {boolean} unlessLate not where earlier ones are still on their way out
   */
  send(name, args, unlessLate) {
    const socket = this.openSocket;
    if (!socket || (unlessLate && socket.bufferedAmount > 0)) return;
    socket.send(JSON.stringify({ id: ++this.number, do: name, ...args }));
  }

  get openSocket() {
    return this.socket && this.socket.readyState === WebSocket.OPEN ? this.socket : null;
  }

  /**
   * @param {string} token
   * @returns {Promise<number>} the status of the answer
   */
  async signIn(token) {
    // another page of this browser may have signed in, and would be signed out now
    this.session = await this.whoAmI();
    if (this.session.signed_in) {
      this.connect();
      return 200;
    }
    const answer = await this.fetch('session', { method: 'POST', body: JSON.stringify({ token }) });
    if (answer.ok) this.connect();
    return answer.status;
  }

  /** Whether it could be done. */
  async signOut() {
    this.leaving = true; // the socket may be closed before the answer is here
    const answer = await this.fetch('session', { method: 'DELETE' }).catch(() => null);
    this.leaving = Boolean(answer && answer.ok);
    return this.leaving;
  }

  /**
   * What this page alone may ask for. Where there is a new session meanwhile, begun by another page
   * of this browser (all of them share the cookie) or because the old one had become too old, it is
   * asked for once more in the name of that.
   * @param {string} path
   * @param {RequestInit} [init]
   */
  async fetch(path, init) {
    const xsrf = this.xsrf;
    const ask = () => fetch(path, { cache: 'no-store', ...init, headers: { 'X-Xsrf': this.xsrf } });
    const answer = await ask();
    if (answer.status !== 403 && answer.status !== 401) return answer;
    if (this.xsrf === xsrf) this.session = await this.whoAmI(); // else it is another one already
    // which asks for the token
    if (!this.session?.signed_in && this.connected && !this.leaving) this.connect();
    return this.xsrf === xsrf ? answer : ask();
  }

  get xsrf() { return this.session ? this.session.xsrf : ''; }
}
