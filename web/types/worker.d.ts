// What the server tells the service worker, in a line before the worker's own text.

interface ServiceWorkerGlobalScope {
  readonly offline: {
    /** Hash of all static files. */
    readonly version: string;
    /** Addresses of the files that the surgeon's page needs. */
    readonly files: readonly string[];
  };
}
