// Sends one order at a time, so that the last one given arrives last. An order that was replaced by a newer one before
// it could be sent is left out.

/** @template Order */
export class Orders {
  /** Whether an order is on its way. */
  busy = false;
  #send;
  /** @type {{ order: Order } | null} */
  #next = null;

  /** @param {(order: Order) => Promise<void>} send must not reject */
  constructor(send) {
    this.#send = send;
  }

  /** @param {Order} order */
  async give(order) {
    this.#next = { order };
    if (this.busy) return;

    this.busy = true;
    while (this.#next) {
      const { order: next } = this.#next;
      this.#next = null;
      await this.#send(next);
    }
    this.busy = false;
  }
}
