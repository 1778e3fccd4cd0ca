// German texts of logging in and out.

export const LOGIN = {
  "login.title": "Anmelden",
  "login.intro": "Dieses Panel ist für alle, die ein Token haben. Wer NeNa bei Ihnen betreibt, gibt Ihnen eines.",
  "login.token": "Token",
  "login.submit": "Anmelden",
  "login.wrong": "Niemand hat dieses Token. Bitte prüfen, ob es vollständig kopiert wurde.",
  "login.failed": "Der Statusaggregator antwortet nicht wie erwartet. Bitte erneut versuchen.",
  "login.out": "Abmelden",
  "login.as": "Angemeldet als {user}, {role}",
  "login.viewer": "darf zusehen",
  "login.operator": "darf Aufträge geben",
  "login.admin": "darf alles",
  "login.noCommands": "Sie dürfen zusehen, aber keine Befehle geben. Wer NeNa bei Ihnen betreibt, kann das ändern.",
};
