/** A table. On a phone, each row is a block in which each value has the name of its column. */

import type { ReactNode } from "react";

export interface Column {
  name: string;
  /** Numbers are aligned at the right. */
  number?: boolean;
}

export interface Row {
  key: string | number;
  cells: readonly ReactNode[];
  /** Whether it is a part of the row above. */
  part?: boolean;
}

interface TableProps {
  title: string;
  columns: readonly Column[];
  rows: readonly Row[];
  /** Whether it fits on a phone without conversion into blocks. */
  narrow?: boolean;
}

export function Table({ title, columns, rows, narrow = false }: TableProps) {
  return (
    <table className="fleet-table" data-narrow={narrow || undefined}>
      <caption className="hidden-but-read">{title}</caption>
      <thead>
        <tr>
          {columns.map(({ name, number }) => (
            <th key={name} scope="col" data-number={number || undefined}>
              {name}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {rows.map(({ key, cells, part }) => (
          <tr key={key} data-part={part || undefined}>
            {columns.map(({ name, number }, index) => (
              <td key={name} data-label={name} data-number={number || undefined}>
                {cells[index]}
              </td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
