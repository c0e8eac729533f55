"""Who may ask the server for anything: the browser that was given the token, on this machine."""

import secrets
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

ADDRESS = "127.0.0.1"
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src "
    "'self' data: blob:; font-src 'self' data:; connect-src 'self' ws://{host}; frame-ancestors 'self'; form-action "
    "'self'; base-uri 'self'; object-src 'none'"
)
"""Vue makes functions of its templates, hence the eval; nothing is loaded from elsewhere."""


@dataclass(frozen=True)
class Guard:
    """An ASGI application that stands before another, before every request and every socket.

    Refused is what wasn't asked of this machine by its own name (a page elsewhere may point its own
    at 127.0.0.1), what a page of another origin asks, and what comes without the token. The token
    comes once in the address, which then loses it, and then in a cookie that no script can read and
    no other site's page sends.

    Parameters
    ----------
    application : ASGIApp
        What it stands before.
    token : str
        The secret.
    port : int
        On which it is served.
    once : set of str
        Other secrets, each of which lets one in once: arguments of a browser that is begun are seen by all.
    """

    application: ASGIApp
    token: str
    port: int
    once: set[str] = field(default_factory=set)

    @property
    def cookie(self) -> str:
        """Its name; browsers don't tell ports apart."""
        return f"legfem-{self.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.application(scope, receive, send)
            return
        headers = Headers(scope=scope)
        why = self._foreign(headers)
        if why:
            await _refused(why, scope, receive, send)
        elif self._known(headers):
            await self.application(scope, receive, self._sealed(send, headers["host"]))
        elif scope["type"] == "http" and scope["method"] == "GET" and self._shown(scope):
            await self._let_in(scope)(scope, receive, send)
        else:
            await _refused("no token: open the address that legfem printed when it was started", scope, receive, send)

    def _foreign(self, headers: Headers) -> str:
        hosts = {f"{name}:{self.port}" for name in (ADDRESS, "localhost")}
        if headers.get("host") not in hosts:
            return "the Host header isn't this server's"
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{headers['host']}":
            return "the Origin header isn't this server's"
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return "a page of another origin asked"
        return ""

    def _known(self, headers: Headers) -> bool:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return found is not None and self._is_token(found.value)

    def _shown(self, scope: Scope) -> bool:
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if given in self.once:
            self.once.remove(given)
            return True
        return self._is_token(given)

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode("utf-8", "replace"), self.token.encode())

    def _let_in(self, scope: Scope) -> RedirectResponse:
        query = parse_qs(scope["query_string"].decode("latin-1"))
        query.pop("token")
        # A path that begins with two slashes would lead to another machine.
        path = "/" + scope["path"].lstrip("/\\")
        response = RedirectResponse(path + (f"?{urlencode(query, True)}" if query else ""), 303)
        response.set_cookie(self.cookie, self.token, httponly=True, samesite="strict", max_age=30 * 86400)
        return response

    @staticmethod
    def _sealed(send: Send, host: str) -> Send:
        async def sealed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.setdefault("content-security-policy", _POLICY.format(host=host))
                headers.update({"x-content-type-options": "nosniff", "referrer-policy": "no-referrer"})
            await send(message)

        return sealed


async def _refused(why: str, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": why})
        return
    await PlainTextResponse(f"refused: {why}\n", 403)(scope, receive, send)
