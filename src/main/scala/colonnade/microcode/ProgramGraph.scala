package colonnade.microcode

/** Draws a program's states. */
private[microcode] object ProgramGraph {

  /** A label, its steps and what they wait for. */
  private final case class Node(name: String, steps: Int, waits: Seq[String], edges: Seq[Edge])

  private final case class Edge(target: String, reasons: Seq[String])

  /** The graph in Graphviz's DOT.
    *
    * @param count    steps of the program
    * @param labels   with the number of their step
    * @param branches by the number of their step
    */
  def draw(name: String, count: Int, labels: Seq[(Label, Int)], branches: Map[Int, Seq[Exit[Label]]]): String = {
    val starts = labels.sortBy(_._2)
    val ends   = starts.map(_._2).drop(1) :+ count
    val nodes  = starts.zip(ends).map { case ((label, start), end) =>
      val exits  = (start until end).flatMap(branches.getOrElse(_, Nil))
      val onward = starts.collectFirst {
        case (next, position) if position == end && !branches.get(end - 1).exists(_.lastOption.exists(isAlways)) =>
          (next.toString, if (branches.get(end - 1).exists(_.exists(_.target.nonEmpty))) "otherwise" else "")
      }
      val jumps = exits.collect { case Exit(Some(target), condition, reason) =>
        (target.toString, if (condition.isEmpty && exits.exists(_.target.exists(_ ne target))) "otherwise" else reason)
      }
      val targets = (jumps ++ onward).map(_._1).distinct
      Node(
        label.toString,
        end - start,
        exits.collect { case Exit(None, _, reason) => reason }.distinct,
        targets.map(target => Edge(target, (jumps ++ onward).collect { case (`target`, why) => why }.distinct))
      )
    }
    render(name, nodes)
  }

  private def isAlways(exit: Exit[Label]): Boolean = exit.condition.isEmpty

  private def render(name: String, nodes: Seq[Node]): String = {
    val shapes = nodes.map { node =>
      val steps = if (node.steps == 1) "1 step" else s"${node.steps} steps"
      val lines = Seq(node.name, steps) ++ node.waits.map(wait => s"until $wait")
      s"""  ${node.name} [label="${lines.mkString("\\n")}"];"""
    }
    val arrows = for (node <- nodes; edge <- node.edges) yield {
      val text = edge.reasons.filter(_.nonEmpty).mkString(",\\n")
      s"  ${node.name} -> ${edge.target}" + (if (text.isEmpty) ";" else s""" [label="$text"];""")
    }
    val style = Seq(
      """  node [shape=box, style=rounded, fontname="Helvetica", fontsize=11];""",
      """  edge [fontname="Helvetica", fontsize=9];"""
    )
    (Seq(s"""// Drawn by colonnade.ProgramGraphs from the program; do not edit.""", s"""digraph "$name" {""") ++
      style ++ shapes ++ arrows :+ "}\n").mkString("\n")
  }
}
