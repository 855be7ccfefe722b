// The one WebSocket: connects again by itself, and says when data has become old.

const RETRY_FIRST_MS = 250, RETRY_LAST_MS = 1000, ACKNOWLEDGE_EVERY = 4, SILENT_MS = 1500, WATCH_MS = 500;

export class Connection {
  constructor(introduction, handlers, changed) {
    this.introduction = introduction;
    this.handlers = handlers;
    this.changed = changed;
    this.open = false;
    this.retryMs = RETRY_FIRST_MS;
    this.decoder = new TextDecoder();
    this.owed = [];
    this.heardMs = performance.now();
    this.connect();
    this.watchedMs = performance.now();
    setInterval(() => this.watch(), WATCH_MS);
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/ws`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.retryMs = RETRY_FIRST_MS;
      this.heardMs = performance.now();
      this.acknowledged = 0;
      this.introduce();
      for (const message of this.owed.splice(0)) this.send(message);
    };
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = () => this.lost();
  }

  introduce() {
    this.send({ do: "introduce", ...this.introduction() });
  }

  receive(data) {
    this.heardMs = performance.now();
    if (!this.open) this.set(true);
    for (const message of JSON.parse(this.decoder.decode(data))) {
      this.handlers[message.kind]?.(message);
      if (message.kind === "frame" && message.n - this.acknowledged >= ACKNOWLEDGE_EVERY) {
        this.acknowledged = message.n;
        this.send({ do: "got", n: message.n });
      }
    }
  }

  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  // An emergency stop is never forgotten: it goes out as soon as there is a connection again.
  sendSurely(message) {
    if (!this.send(message)) this.owed = [message];
  }

  watch() {
    const nowMs = performance.now(), silentMs = nowMs - this.heardMs;
    const stalled = nowMs - this.watchedMs > 2 * WATCH_MS;
    this.watchedMs = nowMs;
    if (stalled) return; // it was this page that did not run; messages may wait to be read
    if (this.open && silentMs > SILENT_MS) this.set(false);
    if (silentMs > 3 * SILENT_MS && this.socket.readyState === WebSocket.OPEN) this.socket.close();
  }

  lost() {
    this.set(false);
    setTimeout(() => this.connect(), this.retryMs);
    this.retryMs = Math.min(2 * this.retryMs, RETRY_LAST_MS);
  }

  set(open) {
    this.open = open;
    this.changed(open);
  }
}
