// German texts of logging in and out.

export const LOGIN = {
  "login.title": "Anmelden",
  "login.intro": "Dieses Panel ist für alle, die ein Token haben. Wer NeNa bei Ihnen betreibt, gibt Ihnen eines.",
  "login.token": "Token",
  "login.submit": "Anmelden",
  "login.wrong": "Niemand hat dieses Token. Bitte prüfen, ob es vollständig kopiert wurde.",
  "login.failed": "Der Statusaggregator antwortet nicht wie erwartet. Bitte erneut versuchen.",
  "login.issuer": "Mit dem Konto Ihrer Organisation anmelden",
  "login.problem.away": "Der Anmeldedienst Ihrer Organisation antwortet nicht. Bitte später erneut versuchen oder mit einem Token anmelden.",
  "login.problem.expired": "Die Anmeldung hat zu lange gedauert oder wurde in einem anderen Fenster begonnen. Bitte neu beginnen.",
  "login.problem.refused": "Der Anmeldedienst Ihrer Organisation hat Sie nicht zugelassen.",
  "login.problem.role": "Sie sind bekannt, haben hier aber keine Rolle. Wer NeNa bei Ihnen betreibt, kann Ihnen eine geben lassen.",
  "login.problem.unfit": "Die Antwort des Anmeldedienstes ist nicht brauchbar. Wer NeNa bei Ihnen betreibt, findet den Grund im Log des Statusaggregators.",
  "login.out": "Abmelden",
  "login.as": "Angemeldet als {user}, {role}",
  "login.viewer": "darf zusehen",
  "login.operator": "darf Aufträge geben",
  "login.admin": "darf alles",
  "login.noCommands": "Sie dürfen zusehen, aber keine Befehle geben. Wer NeNa bei Ihnen betreibt, kann das ändern.",
};
