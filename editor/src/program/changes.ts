/** Changes of a value that the server stores. One before the answer to the former builds on what was sent. */
export class Changes<T> {
  private sent: T | undefined;
  private pending = 0;

  /** Change the stored value, or the sent one while its answer is missing. Return the answer. */
  async apply<Answer>(stored: T, change: (value: T) => T, send: (value: T) => Promise<Answer>): Promise<Answer> {
    const value = change(this.pending > 0 && this.sent !== undefined ? this.sent : stored);
    this.sent = value;
    this.pending += 1;
    try {
      return await send(value);
    } finally {
      this.pending -= 1;
    }
  }
}
