/** Successive changes of a stored value. A change before the answer to the last one starts from the sent value. */
export class Changes<T> {
  private sent: T | undefined;
  private pending = 0;

  /** Change the stored value, or the last sent one while its answer is pending. Return the answer. */
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
