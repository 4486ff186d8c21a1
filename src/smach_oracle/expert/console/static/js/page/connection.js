// The connection: it comes back by itself; sections are kept while it is away.

const LONGEST_PAUSE_S = 4;
const REQUEST_LIMIT_S = 20;
const SIGNED_OUT = 4001; // as the server closes the sockets of a session that has ended

export class Lost extends Error {}

export class Store {
  constructor() {
    this.sections = new Map();
    this.listeners = [];
    this.eventListeners = [];
    this.offset = 0;
  }

  get(name) { return this.sections.get(name); }

  // The server's clock, in seconds.
  now() { return Date.now() / 1000 + this.offset; }

  onChange(listener) { this.listeners.push(listener); }

  onEvents(listener) { this.eventListeners.push(listener); }

  take(message) {
    this.offset = message.now - Date.now() / 1000;
    const names = Object.keys(message.sections || {});
    if (message.all) names.push(...[...this.sections.keys()].filter((name) => !(name in message.sections))); // gone meanwhile
    for (const name of names) {
      if (message.sections[name] === null || message.sections[name] === undefined) this.sections.delete(name);
      else this.sections.set(name, message.sections[name]);
    }
    if (names.length) this.listeners.forEach((listener) => listener(names));
    if (message.events) this.eventListeners.forEach((listener) => listener(message.events));
  }
}

// `onState` is told: connecting, signed-out, connected, lost; with what the server says of the session. `onEnd`: that the
// person has signed out on another page of this browser.
export class Link {
  constructor(store, onState, onEnd) {
    this.store = store;
    this.onState = onState;
    this.onEnd = onEnd;
    this.waiting = new Map();
    this.number = 0;
    this.pause = 0.3;
    this.generation = 0;
    this.session = null;
    this.connected = false;
    this.signedOut = false;
    // signed out: another page of this browser may have signed in meanwhile
    const hurry = () => { if (!this.connected && !document.hidden && (this.timer || this.signedOut)) this.connect(); };
    window.addEventListener('online', hurry);
    window.addEventListener('focus', hurry);
    document.addEventListener('visibilitychange', hurry);
  }

  async connect() {
    clearTimeout(this.timer);
    this.timer = 0;
    const generation = ++this.generation;
    if (this.socket) this.socket.close();
    this.onState('connecting', this.session);
    try {
      const session = await this.whoAmI();
      if (generation !== this.generation) return;
      this.session = session;
    } catch (err) {
      if (generation === this.generation) this.again();
      return;
    }
    this.signedOut = !this.session.signed_in;
    if (this.signedOut) this.onState('signed-out', this.session);
    else this.open(generation);
  }

  async whoAmI() {
    const answer = await fetch('session', { cache: 'no-store', signal: AbortSignal.timeout(8000) });
    if (!answer.ok) throw new Lost();
    return answer.json();
  }

  open(generation) {
    const address = new URL('socket', location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    const socket = this.socket = new WebSocket(address);
    socket.onmessage = (event) => this.take(JSON.parse(event.data));
    socket.onclose = (event) => {
      if (event.code === SIGNED_OUT && !this.leaving) this.onEnd();
      if (generation !== this.generation) return;
      this.fail();
      this.again();
    };
    socket.onopen = async () => {
      try {
        const reply = await this.request('hello', { xsrf: this.session.xsrf, expert: this.expert || '' });
        if (!reply.ok || generation !== this.generation) return;
        this.pause = 0.3;
        this.connected = true;
        this.onState('connected', Object.assign(this.session, { expert: reply.message }));
      } catch (err) {
        if (!(err instanceof Lost)) throw err;
      }
    };
  }

  again() {
    this.connected = false;
    this.onState('lost', this.session);
    this.timer = setTimeout(() => this.connect(), this.pause * 1000);
    this.pause = Math.min(LONGEST_PAUSE_S, this.pause * 1.7);
  }

  fail() {
    this.connected = false;
    for (const waiting of this.waiting.values()) waiting.reject(new Lost('the connection was lost'));
    this.waiting.clear();
  }

  take(message) {
    if (message.re === undefined) {
      this.store.take(message);
      return;
    }
    const waiting = this.waiting.get(message.re);
    this.waiting.delete(message.re);
    if (waiting) waiting.resolve(message);
  }

  // One command; rejects with Lost where the connection goes before the reply is there.
  request(name, args) {
    if (!this.socket || this.socket.readyState !== WebSocket.OPEN) return Promise.reject(new Lost('not connected'));
    const number = ++this.number;
    return new Promise((resolve, reject) => {
      this.waiting.set(number, { resolve, reject });
      setTimeout(() => {
        if (this.waiting.delete(number)) reject(new Lost('no reply within ' + REQUEST_LIMIT_S + ' s'));
      }, REQUEST_LIMIT_S * 1000);
      this.socket.send(JSON.stringify(Object.assign({ id: number, do: name }, args)));
    });
  }

  // A command whose reply nobody waits for. `unlessLate`: not where earlier ones are still on their way out.
  tell(name, args, unlessLate) {
    if (!this.socket || this.socket.readyState !== WebSocket.OPEN || (unlessLate && this.socket.bufferedAmount > 0)) return;
    this.socket.send(JSON.stringify(Object.assign({ id: ++this.number, do: name }, args)));
  }

  async signIn(token) {
    const known = await this.whoAmI(); // another page of this browser may have signed in, and would be signed out now
    Object.assign(this.session, known);
    if (known.signed_in) {
      this.connect();
      return 200;
    }
    const answer = await this.fetch('session', { method: 'POST', body: JSON.stringify({ token }) });
    if (answer.ok) this.connect();
    return answer.status;
  }

  // Whether it could be done.
  async signOut() {
    this.leaving = true; // the socket may be closed before the answer is here
    const answer = await this.fetch('session', { method: 'DELETE' }).catch(() => null);
    this.leaving = Boolean(answer && answer.ok);
    return this.leaving;
  }

  // What this page alone may ask for. Where there is a new session meanwhile, begun by another page of this browser (all of
  // them share the cookie) or because the old one had become too old, it is asked for once more in the name of that.
  async fetch(path, options) {
    const { xsrf } = this.session;
    const ask = () => fetch(path, Object.assign({ cache: 'no-store' }, options, { headers: { 'X-Xsrf': this.session.xsrf } }));
    const answer = await ask();
    if (answer.status !== 403 && answer.status !== 401) return answer;
    if (this.session.xsrf === xsrf) {
      const known = await this.whoAmI();
      Object.assign(this.session, known); // that of now: meanwhile it may be another one
    }
    if (!this.session.signed_in && this.connected && !this.leaving) {
      this.fail();
      this.connect(); // which asks for the token
    }
    return this.session.xsrf === xsrf ? answer : ask();
  }
}
