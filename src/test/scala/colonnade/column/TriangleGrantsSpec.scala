package colonnade.column

import chiseltest._
import colonnade.Proofs
import org.scalatest.flatspec.AnyFlatSpec

class TriangleGrantsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "TriangleGrants"

  for (count <- Seq(2, 3, 5))
    it should s"never overfill the queue, and starve none of $count rows" in
      prove(new TriangleGrantsProof(count))
}
