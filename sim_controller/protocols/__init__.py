"""How a control talks on its line: one file a protocol, named after it; `_name` is a helper.

A protocol file offers `serve(line, session, once)`: it talks over `line` until the other side hangs up, or until one program
has ended when `once` is set. `session` (`sim_controller.session.Session`) makes the control that executes what arrives.
"""
