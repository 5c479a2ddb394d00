// The step shown, playback, and the address of the step.

const LONGEST_S = 0.25; // a page that was hidden continues where it was
const REST_MS = 150; // delay of the address: browsers limit how often it changes

class Playback {
  /**
   * @param {number} last - the last step
   * @param {number} dt - time from step to step [s]
   * @param {function(): void} changed - called when the step or the state of playing changes
   */
  constructor(last, dt, changed) {
    Object.assign(this, { last, dt, changed, step: 0, playing: false, speed: 1 });
    window.addEventListener("hashchange", () => this.#follow());
    this.#follow();
  }

  /** Show a step; one out of range becomes the first or the last. */
  go(step) {
    const next = Math.min(Math.max(Math.round(step), 0), this.last);
    if (next === this.step) return;
    this.step = next;
    clearTimeout(this.rest);
    this.rest = setTimeout(() => this.#write(), this.playing ? 10 * REST_MS : REST_MS);
    this.changed();
  }

  /** Play from here, or from the start if this is the end. */
  play() {
    if (this.step === this.last) this.go(0);
    this.playing = true;
    let before = performance.now();
    let owed = 0;
    const tick = (now) => {
      owed += (Math.min((now - before) / 1000, LONGEST_S) / this.dt) * this.speed;
      before = now;
      if (owed >= 1) this.go(this.step + Math.floor(owed));
      owed %= 1;
      if (this.step === this.last) this.pause();
      else this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
    this.changed();
  }

  /** Stop here. */
  pause() {
    this.playing = false;
    cancelAnimationFrame(this.frame); // else it would run alongside the next playback
    this.#write();
    this.changed();
  }

  /** Play or pause. */
  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  #follow() {
    const found = /step=(\d+)/.exec(window.location.hash);
    if (found) this.go(Number(found[1]));
  }

  #write() {
    clearTimeout(this.rest);
    try {
      window.history.replaceState(null, "", `#step=${this.step}`);
    } catch {
      // A sandboxed frame cannot change its address.
    }
  }
}
