package colonnade.frame

/** Morton order, by sorting. */
object Morton {

  /** The cells of a grid in Morton order. */
  def cells(wide: Int, high: Int): Seq[(Int, Int)] =
    (for (x <- 0 until wide; y <- 0 until high) yield (x, y)).sortBy { case (x, y) => code(x, y) }

  private def code(x: Int, y: Int): Long =
    (0 until 16).map(bit => ((x >> bit & 1L) << (2 * bit)) | ((y >> bit & 1L) << (2 * bit + 1))).sum
}
