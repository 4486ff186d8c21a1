"""A state that calls a service."""

import copy
import threading
import time
import traceback
from typing import Any, Callable, Dict, Iterable, Optional

import rospy

import smach
from smach_ros.user_callback import UserCallback
from smach_ros.waiting import Aside, Signal, seconds, shutting_down

__all__ = ['ServiceState']

LOOK_FOR_SERVICE_S = 2.0
"""How long the master's answer and the connection to the service may take together; rospy tries
thrice a second.
"""
PAUSE_S = 0.05
REMIND_EVERY_S = 5.0


class ServiceState(smach.State):
    """Calls a service: 'succeeded' when it answers, 'aborted' when it fails, 'preempted' on a
    preempt or a shutdown.

    The request starts from ``request``, is replaced by the one in userdata under ``request_key``,
    has the fields ``request_slots`` filled from the userdata keys of the same names, and goes
    through ``request_cb(userdata, request, *args, **kwargs)``, which may change it or return
    another. The response goes to ``response_cb(userdata, response, *args, **kwargs)``, which may
    return one of ``outcomes``, then to userdata as a whole (``response_key``) or by field
    (``response_slots``).

    The first execution waits for an absent service until it comes. A service that has gone since
    aborts later ones. A service cannot be cancelled: a preempt leaves a call ``preempt_timeout``
    (``rospy.Duration`` or seconds of wall time) to finish, then walks away from it.
    """

    def __init__(
        self,
        service_name: str,
        service_spec: Any,
        request: Any = None,
        request_cb: Optional[Callable[..., Any]] = None,
        request_cb_args: Iterable[Any] = (),
        request_cb_kwargs: Optional[Dict[str, Any]] = None,
        request_key: Optional[str] = None,
        request_slots: Iterable[str] = (),
        response_cb: Optional[Callable[..., Any]] = None,
        response_cb_args: Iterable[Any] = (),
        response_cb_kwargs: Optional[Dict[str, Any]] = None,
        response_key: Optional[str] = None,
        response_slots: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        preempt_timeout: Any = rospy.Duration(5.0),
    ) -> None:
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
        input_keys, output_keys = tuple(input_keys), tuple(output_keys)
        self.register_outcomes(list(outcomes))
        self.register_input_keys(input_keys)
        self.register_output_keys(output_keys)
        self._service_name = service_name
        self._service_spec = service_spec
        self._preempt_timeout = preempt_timeout
        self._signal = Signal()
        self._request = service_spec._request_class() if request is None else request
        self._request_key = request_key
        self._request_slots = tuple(request_slots)
        self._request_cb: Optional[UserCallback] = None
        if request_cb is not None:
            self._request_cb = UserCallback(
                'request_cb',
                request_cb,
                request_cb_args,
                request_cb_kwargs,
                input_keys,
                output_keys,
            )
            self._request_cb.register_with(self)
        self._response_key = response_key
        self._response_slots = tuple(response_slots)
        self._response_cb: Optional[UserCallback] = None
        if response_cb is not None:
            self._response_cb = UserCallback(
                'response_cb',
                response_cb,
                response_cb_args,
                response_cb_kwargs,
                input_keys,
                output_keys,
            )
            self._response_cb.register_with(self, decides=True)
        self._register_message_keys()
        self._proxy: Any = None

    def _register_message_keys(self) -> None:
        self.register_input_keys([key for key in (self._request_key,) if key is not None])
        self.register_input_keys(self._request_slots)
        self.register_output_keys([key for key in (self._response_key,) if key is not None])
        self.register_output_keys(self._response_slots)

    def request_preempt(self) -> None:
        """Ask to stop. Waiting for an absent service ends at once."""
        smach.State.request_preempt(self)
        self._signal.notify()

    def execute(self, ud: Any) -> str:
        """Wait for the service, call it, hand the answer to userdata."""
        if not self._await_service():
            smach.loginfo("Preempted before calling service '%s'." % self._service_name)
            self.service_preempt()
            return 'preempted'
        request = self._make_request(ud)
        if request is None:
            return 'aborted'
        call = self._call(request)
        if not call.ended:
            smach.logwarn(
                "Service '%s' still works on a request that was preempted; going on without its "
                'answer.' % self._service_name
            )
            self.service_preempt()
            return 'preempted'
        if isinstance(call.error, (rospy.ServiceException, rospy.ROSException, OSError)):
            smach.logerr("The call of service '%s' failed: %s" % (self._service_name, call.error))
            return 'aborted'
        if call.error is not None:
            raise call.error
        return self._use_response(ud, call.value)

    def _await_service(self) -> bool:
        """True once the service is there, or was before. It is False on a preempt or a shutdown."""
        if self._proxy is not None:
            return not self.preempt_requested()
        search = Aside('find %s' % self._service_name, self._signal, self._find_service)
        self._signal.wait(lambda: search.ended or self.preempt_requested())
        search.stop()
        if search.error is not None:
            raise search.error
        return search.ended and bool(search.value) and not self.preempt_requested()

    def _find_service(self, stopped: threading.Event) -> bool:
        remind_at = time.monotonic() + REMIND_EVERY_S
        while not stopped.is_set() and not shutting_down():
            try:
                rospy.wait_for_service(self._service_name, LOOK_FOR_SERVICE_S)
                return True
            except (rospy.ROSException, OSError):
                if time.monotonic() >= remind_at:
                    smach.logwarn(
                        "Service '%s' is not there yet; the state waits on." % self._service_name
                    )
                    remind_at += REMIND_EVERY_S
                stopped.wait(PAUSE_S)
        return False

    def _make_request(self, ud: Any) -> Any:
        """The request to send, or None if userdata or callback do not provide one (logged)."""
        try:
            request = copy.deepcopy(
                self._request if self._request_key is None else ud[self._request_key]
            )
            for slot in self._request_slots:
                setattr(request, slot, ud[slot])
        except (KeyError, AttributeError) as err:
            smach.logerr(
                "Cannot fill the request of service '%s' from userdata: %r"
                % (self._service_name, err)
            )
            return None
        if self._request_cb is None:
            return request
        try:
            update = self._request_cb(ud, request)
        except Exception:
            smach.logerr(
                "Request callback for service '%s' raised:\n%s"
                % (self._service_name, traceback.format_exc())
            )
            return None
        return request if update is None else update

    def _call(self, request: Any) -> Aside:
        """Call in a thread of its own, so that neither a preempt nor Ctrl-C hangs on a service that
        does not answer.
        """
        if self._proxy is None:
            self._proxy = rospy.ServiceProxy(self._service_name, self._service_spec)
        call = Aside(
            'call %s' % self._service_name, self._signal, lambda stopped: self._proxy(request)
        )
        self._signal.wait(lambda: call.ended or self.preempt_requested())
        if not call.ended and not shutting_down():
            self._signal.wait(lambda: call.ended, longest_s=seconds(self._preempt_timeout))
        return call

    def _use_response(self, ud: Any, response: Any) -> str:
        outcome = self._ask_response_cb(ud, response)
        if self._response_key is not None:
            ud[self._response_key] = response
        for slot in self._response_slots:
            ud[slot] = getattr(response, slot)
        return outcome

    def _ask_response_cb(self, ud: Any, response: Any) -> str:
        if self._response_cb is None:
            return 'succeeded'
        try:
            outcome = self._response_cb(ud, response)
        except Exception:
            smach.logerr(
                "Response callback for service '%s' raised:\n%s"
                % (self._service_name, traceback.format_exc())
            )
            return 'aborted'
        if outcome is None or outcome in self.get_registered_outcomes():
            return 'succeeded' if outcome is None else outcome
        smach.logerr(
            "Response callback for service '%s' returned %r, but the registered outcomes are %s"
            % (self._service_name, outcome, sorted(self.get_registered_outcomes()))
        )
        return 'aborted'
