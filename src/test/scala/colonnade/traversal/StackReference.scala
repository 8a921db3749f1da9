package colonnade.traversal

/** Reference model of [[TraversalStack]], one operation at a time. */
final class StackReference(contexts: Int, stackDepth: Int) {
  import StackReference._

  private val stacks = Array.fill(contexts)(List.empty[Child])
  var deepest        = 0
  var overflows      = 0

  def start(context: Int): Unit = stacks(context) = Nil

  def result(context: Int, children: Seq[Child], tMax: BigInt): Option[Child] = {
    for (child <- children.drop(1).reverse)
      if (stacks(context).size < stackDepth) stacks(context) = child :: stacks(context) else overflows += 1
    deepest = deepest.max(stacks(context).size)
    children.headOption.orElse(resume(context, tMax))
  }

  /** None if the stack is empty. */
  def resume(context: Int, tMax: BigInt): Option[Child] = {
    val rest = stacks(context).dropWhile(_.tNear > tMax)
    stacks(context) = rest.drop(1)
    rest.headOption
  }
}

object StackReference {
  final case class Child(isLeaf: Boolean, address: BigInt, tNear: BigInt)
}
