"""`rclpy.task.Future`."""


class Future:

    def __init__(self):
        self._done, self._result, self._callbacks = False, None, []

    def done(self):
        return self._done

    def result(self):
        return self._result

    def set_result(self, result):
        self._done, self._result = True, result
        for callback in self._callbacks:
            callback(self)

    def add_done_callback(self, callback):
        if self._done:
            callback(self)
        else:
            self._callbacks.append(callback)
