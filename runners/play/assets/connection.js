// The socket to the session, which asks one thing at a time.

const AGAIN_MS = 1000;
const TAKEN_OVER = 4001; // see runners/play/server.py

class Connection {
  /** @param {{message: function(Object, ?Object), opened: function(), lost: function(boolean)}} hears */
  constructor(hears) {
    this.hears = hears;
    this.waiting = new Map();
    this.ticket = 0;
    this.open();
  }

  /** Connect, also again. */
  open() {
    const address = new URL("socket", window.location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.hears.opened();
    this.socket.onmessage = ({ data }) => this.#hear(data);
    this.socket.onclose = ({ code }) => this.#lost(code === TAKEN_OVER);
  }

  /** Ask for something; the promise is kept when it has been answered, or will not be. */
  ask(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.resolve(false);
    const ticket = ++this.ticket;
    this.socket.send(JSON.stringify({ ...message, ticket }));
    return new Promise((done) => this.waiting.set(ticket, done));
  }

  #hear(data) {
    if (typeof data !== "string") {
      const { head, arrays } = parse(data);
      this.hears.message(head, arrays);
      return;
    }
    const message = JSON.parse(data);
    if (message.type !== "done") {
      this.hears.message(message, null);
      return;
    }
    this.waiting.get(message.ticket)?.(true);
    this.waiting.delete(message.ticket);
  }

  #lost(takenOver) {
    for (const done of this.waiting.values()) done(false);
    this.waiting.clear();
    this.hears.lost(takenOver);
    if (!takenOver) setTimeout(() => this.open(), AGAIN_MS);
  }
}
