// English texts of logging in and out.

export const LOGIN = {
  "login.title": "Log in",
  "login.intro": "This panel is for those who have a token. Whoever runs NeNa at your site gives you one.",
  "login.token": "Token",
  "login.submit": "Log in",
  "login.wrong": "Nobody has this token. Look whether it was copied whole.",
  "login.failed": "The status aggregator does not answer as it should. Try again.",
  "login.issuer": "Sign in with your organisation's account",
  "login.problem.away": "The sign-in service of your organisation does not answer. Try again later, or log in with a token.",
  "login.problem.expired": "The sign-in took too long, or was begun in another window. Begin again.",
  "login.problem.refused": "The sign-in service of your organisation did not let you in.",
  "login.problem.role": "You are known, but have no role here. Whoever runs NeNa at your site can have you given one.",
  "login.problem.unfit": "The answer of the sign-in service cannot be used. Whoever runs NeNa at your site finds the reason in the status aggregator's log.",
  "login.out": "Log out",
  "login.as": "Logged in as {user}, {role}",
  "login.viewer": "may look",
  "login.operator": "may give orders",
  "login.admin": "may do everything",
  "login.noCommands": "You may look, but give no commands. Whoever runs NeNa at your site can change that.",
};
