// The newest frame of a sensor, again and again: the next one is asked for when the last one is on the screen.

const LEAST_PAUSE_MS = 60;
const TROUBLE_PAUSE_MS = 1000;

// The number of a sensor now; a console that was restarted gives other numbers. undefined where it is gone.
export function numberOf(app, topic, type) {
  const found = ((app.store.get('eye') || {}).sensors || []).find((each) => each.topic === topic && (!type || each.type === type));
  return found && found.id;
}

export class FrameFeed {
  // `which()`: the sensor's number; `root`: an element, nothing is asked for while it is not on the page;
  // `take(answer, facts)`: shows a frame; `say(text)`: '' where all is well; `beside()`: the number of a robot at which
  // the facts shall tell its place, undefined for none
  constructor(app, which, root, { width = 640, take, say, every = LEAST_PAUSE_MS, beside = () => undefined }) {
    Object.assign(this, { app, which, root, width, take, say, every, beside });
    this.times = [];
    this.running = true;
    this.loop();
  }

  stop() {
    this.running = false;
    if (this.controller) this.controller.abort();
  }

  get rate() {
    const now = performance.now();
    this.times = this.times.filter((time) => now - time < 3000);
    return this.times.length / 3;
  }

  async loop() {
    let after = 0;
    let last;
    while (this.running) {
      const id = this.which();
      const beside = this.beside();
      if (id + ' ' + beside !== last) after = 0;
      last = id + ' ' + beside;
      if (document.hidden || !this.root.isConnected || !this.app.link.connected || id === undefined || id === null) {
        if (id === undefined && this.app.link.connected && this.root.isConnected) this.say('It is gone.');
        await pause(250);
        continue;
      }
      const begun = performance.now();
      let rest = 0;
      try {
        after = await this.once(id, after, beside);
      } catch (err) {
        if (!this.running) return;
        rest = TROUBLE_PAUSE_MS;
        after = 0;
      }
      await pause(Math.max(rest, this.every - (performance.now() - begun)));
      await new Promise((resolve) => requestAnimationFrame(resolve));
    }
  }

  async once(id, after, beside) {
    this.controller = new AbortController();
    const answer = await this.app.link.fetch('frame/' + id + '?after=' + after + '&width=' + this.width + (beside ? '&robot=' + beside : ''),
      { signal: this.controller.signal });
    if (answer.status === 204) {
      this.say(after ? 'Nothing new comes.' : 'Nothing comes.');
      return this.astray ? 0 : after; // the last one again: its place may be known by now
    }
    if (answer.status === 422) {
      this.say(await answer.text());
      return Number(answer.headers.get('X-Sequence')) || 0;
    }
    if (!answer.ok) {
      this.say({ 404: 'It is gone.', 429: 'Too many pictures at a time.', 503: 'Too many pictures at a time.' }[answer.status] || 'Refused (' + answer.status + ').');
      throw new Error(answer.status);
    }
    const told = answer.headers.get('X-Facts');
    const facts = told ? JSON.parse(told) : await answer.json();
    this.astray = Boolean(facts.astray);
    await this.take(answer, facts);
    this.times.push(performance.now());
    this.say('');
    return facts.sequence;
  }
}

function pause(ms) {
  return new Promise((resolve) => setTimeout(resolve, ms));
}
