// English texts of logging in and out.

export const LOGIN = {
  "login.title": "Log in",
  "login.intro": "This panel is for those who have a token. Whoever runs NeNa at your site gives you one.",
  "login.token": "Token",
  "login.submit": "Log in",
  "login.wrong": "Nobody has this token. Look whether it was copied whole.",
  "login.failed": "The status aggregator does not answer as it should. Try again.",
  "login.out": "Log out",
  "login.as": "Logged in as {user}, {role}",
  "login.viewer": "may look",
  "login.operator": "may give orders",
  "login.admin": "may do everything",
  "login.noCommands": "You may look, but give no commands. Whoever runs NeNa at your site can change that.",
};
