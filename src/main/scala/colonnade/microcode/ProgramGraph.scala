package colonnade.microcode

/** Draws a program's states. */
private[microcode] object ProgramGraph {

  /** A label, its steps and what they wait for. */
  private final case class Node(name: String, steps: Int, waits: Seq[String], edges: Seq[Edge])

  private final case class Edge(target: String, reasons: Seq[String])

  private val otherwise = "otherwise"

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
        case (next, `end`) if !branches.get(end - 1).exists(_.exists(_.condition.isEmpty)) => next.toString -> otherwise
      }
      val jumps = exits.collect { case Exit(Some(target), condition, reason) =>
        target.toString -> (if (condition.isEmpty) otherwise else reason)
      } ++ onward
      val edges = jumps.map(_._1).distinct.map(to => Edge(to, jumps.collect { case (`to`, why) => why }.distinct))
      Node(label.toString, end - start, exits.collect { case Exit(None, _, reason) => reason }.distinct, edges)
    }
    render(name, nodes)
  }

  private def render(name: String, nodes: Seq[Node]): String = {
    val shapes = nodes.map { node =>
      val steps = if (node.steps == 1) "1 step" else s"${node.steps} steps"
      val lines = Seq(node.name, steps) ++ node.waits.map(wait => s"until $wait")
      s"""  ${node.name} [label="${lines.mkString("\\n")}"];"""
    }
    val arrows = for (node <- nodes; edge <- node.edges) yield {
      val isOnly = node.edges.size == 1 && edge.reasons == Seq(otherwise)
      s"  ${node.name} -> ${edge.target}" + (if (isOnly) ";" else s""" [label="${edge.reasons.mkString(",\\n")}"];""")
    }
    val style = Seq(
      """  node [shape=box, style=rounded, fontname="Helvetica", fontsize=11];""",
      """  edge [fontname="Helvetica", fontsize=9];"""
    )
    (Seq("// Drawn by tools/program-graphs from the program; do not edit.", s"""digraph "$name" {""") ++
      style ++ shapes ++ arrows :+ "}\n").mkString("\n")
  }
}
